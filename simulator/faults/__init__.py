"""Faults of pumps and of the rising main, as profiles over time. The registry is the union itself."""

from typing import Annotated, get_args

from pydantic import Field

from wetwell.simulator.faults.blockage import Blockage
from wetwell.simulator.faults.pipe_clogging import PipeClogging

Fault = Annotated[Blockage | PipeClogging, Field(discriminator="kind")]
FAULTS = {fault.model_fields["kind"].default: fault for fault in get_args(get_args(Fault)[0])}
