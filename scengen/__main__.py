"""`python -m scengen` is the command `scengen`."""

from .cli import main

if __name__ == "__main__":
    main()
