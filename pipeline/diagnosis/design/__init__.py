"""Detectability of effects by the points of a test, and the further tests that would separate them."""
