"""``python -m pmg.pipeline`` is the command ``pmg``."""

from pmg.pipeline.cli import main

if __name__ == "__main__":
    main()
