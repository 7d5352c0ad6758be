"""What `wetwell gap experiment` prints."""

from collections.abc import Mapping
from typing import Any

from wetwell.services.reports.text_table import folded, text_table


def experiment_lines(told: Mapping[str, Any]) -> str:
    """Acts, the best first, with what they bring and cost, for people."""
    prices = told["prices"]
    source = "defaults: the station file has no [costs]" if prices["are_defaults"] else "of [costs]"
    lines = [f"station '{told['station']}', inflow {told['inflow_m3h']:.0f} m³/h; what the diagnosis leaves:"]
    lines += [f"  {one['probability']:.3f}  {_named(one['effects'])}" for one in told["sets"]]
    acts = told["experiments"]
    if not acts:
        why = "one set is left" if len(told["sets"]) < 2 else "no act tells them apart"
        lines.append(f"no experiment is worth its costs: {why}")
    else:
        rows = [
            {
                "act": one["act"],
                "bit": f"{one['information_bits']:.2f}",
                "truth": f"{one['truth_probability']:.2f}",
                "m³": f"{one['costs_m3']:.0f}",
                "kWh": f"{one['extra_kwh']:+.1f}",
                "work h": f"{one['crew_h']:.1f}",
                "price": f"{one['price']:.0f}",
                "tells apart": "; ".join(_named(names) for names in one["separates"]) or "nothing for sure",
            }
            for one in acts
        ]
        lines += [*text_table(rows), f"best: {acts[0]['sentence']}"]
        lines.append("truth: expected probability of the true set afterwards")
        lines.append(
            f"prices ({source}): {prices['energy_per_kwh']:g} a kWh, {prices['crew_per_hour']:g} an hour of work"
        )
    lines += [f"not allowed: {one['act']}: {one['reason']}" for one in told["refused"]]
    return folded("\n".join(lines))


def _named(effects: list[str]) -> str:
    return " + ".join(effects) or "none"
