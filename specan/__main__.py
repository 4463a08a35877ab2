"""Lets ``python -m specan`` do what ``specan`` does."""

from specan_cli.main import run

if __name__ == "__main__":
    run()
