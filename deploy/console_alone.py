"""`tandem-console`: the console without the other commands, which it would keep in memory for nothing."""

from __future__ import annotations

import typer

from deploy.console.command import console
from deploy.log_options import add_log_options, start_chosen_log
from deploy.run_app import run_app

app = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode="markdown", add_completion=False)
app.command()(console)
add_log_options(app)


def main() -> None:
    """Entry point."""
    start_chosen_log(debug=False, quiet=False)
    run_app(app)


if __name__ == "__main__":
    main()
