"""Inflow models. The registry is the union itself."""

from typing import Annotated, get_args

from pydantic import Field

from wetwell.simulator.inflow.catchment import CatchmentInflow
from wetwell.simulator.inflow.diurnal import DiurnalInflow
from wetwell.simulator.inflow.empirical import EmpiricalInflow
from wetwell.simulator.inflow.recorded import RecordedInflow

Inflow = Annotated[DiurnalInflow | EmpiricalInflow | RecordedInflow | CatchmentInflow, Field(discriminator="kind")]
INFLOWS = {inflow.model_fields["kind"].default: inflow for inflow in get_args(get_args(Inflow)[0])}
