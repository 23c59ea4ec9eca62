"""``python -m pmg.pipeline`` is the command ``pmg``."""

from pmg.pipeline.cli.app import main

if __name__ == "__main__":
    main()
