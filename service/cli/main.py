"""Entry point of the `padwatch` command."""

import typer

app = typer.Typer(no_args_is_help=True, add_completion=False)


@app.callback()
def padwatch() -> None:
    """Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs."""


def main() -> None:
    """Run the command line."""
    app()
