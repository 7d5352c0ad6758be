"""The control-room page."""

import typer

from wetwell.services.commands.options import RUN, ConfigOption, PageOption, ZenohOption, run, settings_of

app = typer.Typer()


@app.command(rich_help_panel=RUN)
def dashboard(zenoh: ZenohOption = None, page: PageOption = None, config: ConfigOption = None) -> None:
    """Show all stations on Zenoh in a browser."""
    settings = settings_of(config, zenoh, page=page)
    from wetwell.services.dashboard.daemon import serve_dashboard

    run(settings, serve_dashboard(settings))
