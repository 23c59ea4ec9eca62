"""The diagnosis: from residuals to an explanation, its rivals, and the test that would tell them apart."""
