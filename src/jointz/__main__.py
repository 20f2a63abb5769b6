"""``python -m jointz``: the command, where its script is not on the path."""

from jointz.cli.main import run

if __name__ == "__main__":
    run()
