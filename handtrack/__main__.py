"""`python -m handtrack` is the command line."""

from handtrack.cli import main

if __name__ == "__main__":
    main()
