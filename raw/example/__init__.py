"""The recordings of the example, shipped as data of the package ``pmg.example``; nothing here is run by pmg."""
