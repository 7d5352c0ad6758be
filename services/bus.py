"""The bus that the settings name."""

from wetwell.protocols.zenoh_link import ZenohBus, connect_client, open_router
from wetwell.services.settings import Settings


async def connect(settings: Settings) -> ZenohBus:
    """Bus through the router of the settings; waits until it is there."""
    return await connect_client(settings.zenoh.endpoint)


def listen(settings: Settings) -> ZenohBus:
    """Bus to which others connect.

    Raises
    ------
    LinkError
        If the endpoint cannot be listened on.
    """
    return open_router(settings.zenoh.endpoint)
