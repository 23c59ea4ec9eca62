"""Reports: plain nouns for what a page holds, and their drawing as HTML, PNG and CSV."""
