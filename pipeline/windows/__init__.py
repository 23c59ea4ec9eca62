"""Windows of a recording that may stand for a test point, judged and reduced to means."""
