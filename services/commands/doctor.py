"""A look at a running site."""

from pathlib import Path
from typing import Annotated

import typer

from wetwell.services.commands.inputs import about
from wetwell.services.commands.options import OPERATE, ConfigOption, JsonOption, ZenohOption, positive, print_result

app = typer.Typer()


@app.command(cls=about("--station"), rich_help_panel=OPERATE)
def doctor(
    station: Annotated[
        list[str] | None,
        typer.Option("--station", metavar="FILE", help="Station that must be there; may be given again."),
    ] = None,
    seconds: Annotated[float, typer.Option("--seconds", metavar="NUMBER", help="How long to listen.")] = 5.0,
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Check by checksums that what is kept here is what was written; needs no bus.",
        ),
    ] = False,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="With --verify: folder of wetwell up, not those of the settings."),
    ] = None,
    zenoh: ZenohOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check a running site and say what is wrong and what to do; exit code 0 well, 1 warnings, 2 errors."""
    import asyncio
    from dataclasses import asdict

    from wetwell.services.doctor.examine import examine
    from wetwell.services.doctor.finding import exit_code, finding_lines

    if verify:
        from wetwell.services.commands.options import settings_of, with_data
        from wetwell.services.doctor.verify import verify_kept

        settings = settings_of(config)
        findings = verify_kept(settings if data is None else with_data(settings, data, data))
    else:
        findings = asyncio.run(examine(config, zenoh, station or [], positive(seconds, "--seconds")))
    if as_json:
        print_result({"findings": [asdict(finding) for finding in findings]}, as_json=True)
    else:
        typer.echo(finding_lines(findings))
    raise typer.Exit(exit_code(findings))
