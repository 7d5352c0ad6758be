"""A shard of the fleet: a task of Dask that judges its stations until it is told to end."""

import asyncio
import logging

from distributed import secede

from wetwell.protocols.bus.interface import Bus, Subscription
from wetwell.protocols.bus.keys import SITE, plan_key
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.order import Plan
from wetwell.services.detector.daemon import judge_all
from wetwell.services.runtime.connection import connect
from wetwell.services.runtime.lifecycle import report_health
from wetwell.services.runtime.logs import start_logging
from wetwell.services.runtime.settings import Settings

log = logging.getLogger(__name__)


def run_shard(settings: Settings, plan: Plan) -> int:
    """Judge the stations of a plan, and of those that follow on the bus, until one bears a later epoch.

    The shard's number. The task leaves Dask's pool of threads, so that a worker can take any number of shards.
    """
    secede()
    start_logging(settings.log, service=f"shard-{plan.shard}")
    return asyncio.run(_work(settings, plan))


async def _work(settings: Settings, plan: Plan) -> int:
    shard, epoch = plan.shard, plan.epoch
    with await connect(settings) as control:
        plans = control.subscribe(plan_key(shard), history=1)
        health = asyncio.create_task(_health(control, settings, shard))
        try:
            while plan.epoch == epoch:
                judging = asyncio.create_task(_judge(settings, plan), name=f"shard.{shard}")
                coming = asyncio.create_task(_next(plans, plan), name=f"shard.{shard}.plan")
                done, _ = await asyncio.wait({judging, coming}, return_when=asyncio.FIRST_COMPLETED)
                for task in (judging, coming):
                    task.cancel()
                await asyncio.gather(judging, coming, return_exceptions=True)
                if judging in done:
                    judging.result()
                plan = coming.result()
        finally:
            health.cancel()
            await asyncio.gather(health, return_exceptions=True)
    log.info("shard %d: ends, epoch %d follows", shard, plan.epoch)
    return shard


async def _judge(settings: Settings, plan: Plan) -> None:
    """Judge with a connection of its own, which ends with the plan: what was subscribed goes with it."""
    with await connect(settings) as bus:
        await judge_all(settings, bus, plan.stations, f"shard-{plan.shard}")
        await asyncio.Event().wait()  # a shard without stations


async def _next(plans: Subscription[bytes], plan: Plan) -> Plan:
    """First plan that is another than the one at hand and not of an earlier epoch."""
    while True:
        for payload in await plans.receive():
            try:
                other = Plan.decode(payload)
            except MessageError as error:
                log.warning("shard %d: %s", plan.shard, error)
                continue
            if other.epoch >= plan.epoch and (other.epoch, other.stations) != (plan.epoch, plan.stations):
                return other


async def _health(bus: Bus, settings: Settings, shard: int) -> None:
    await report_health(bus, SITE, f"shard-{shard}", settings.health.period_s, lambda: {"shard": float(shard)})
