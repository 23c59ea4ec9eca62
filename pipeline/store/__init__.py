"""The store of decoded runs, and the files it is made from."""
