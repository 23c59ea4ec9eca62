"""Reports: plain nouns for what is told, and their drawing as HTML, PNG and CSV."""
