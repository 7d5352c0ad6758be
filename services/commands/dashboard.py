"""The control-room page."""

import typer

from wetwell.services.commands.options import ConfigOption, PageOption, ZenohOption, run, settings_of

app = typer.Typer()


@app.command()
def dashboard(zenoh: ZenohOption = None, page: PageOption = None, config: ConfigOption = None) -> None:
    """Show all stations on Zenoh in a browser."""
    from wetwell.services.dashboard.daemon import serve_dashboard

    settings = settings_of(config, zenoh, page=page)
    run(settings, serve_dashboard(settings))
