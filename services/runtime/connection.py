"""The bus that the settings name."""

from importlib.resources import as_file, files

from wetwell.protocols.bus.roles import AccessTable, load_access
from wetwell.protocols.bus.zenoh.access import ZenohAccess
from wetwell.protocols.bus.zenoh.link import ZenohBus, connect_client, open_router
from wetwell.services.runtime.settings import Settings, ZenohSettings, secret_of
from wetwell.services.security.exposure import check_exposure


async def connect(settings: Settings) -> ZenohBus:
    """Bus through the router of the settings; waits until it is there.

    A member of a pair looks for it as often as a lease lasts: until it is back, its partner has no second.

    Raises
    ------
    ConfigError
        If what shows who this is cannot be read or is not complete.
    """
    endpoint, access, lease = settings.zenoh.endpoint, access_of(settings.zenoh), settings.lease
    if lease.url is None:
        return await connect_client(endpoint, access)
    return await connect_client(endpoint, access, longest_wait_s=lease.ttl_s)


def listen(settings: Settings) -> ZenohBus:
    """Bus to which others connect.

    Raises
    ------
    ConfigError
        If others than this machine could connect without saying who they are, and the settings do not allow it; or if
        a file that they name cannot be read.
    LinkError
        If the endpoint cannot be listened on.
    """
    zenoh, access = settings.zenoh, access_of(settings.zenoh)
    host = zenoh.endpoint.partition("/")[2].rpartition(":")[0]
    check_exposure(
        "the bus",
        host,
        is_protected=access.asks_who(zenoh.endpoint),
        remedy="zenoh.users_file, or a tls/ endpoint with zenoh.tls",
        insecure=settings.security.insecure,
    )
    return open_router(zenoh.endpoint, access, zenoh.upstream)


def access_of(zenoh: ZenohSettings) -> ZenohAccess:
    """Who we are on the bus and whom we let in, with the secrets read from their files.

    Raises
    ------
    ConfigError
        If a file cannot be read or breaks a rule.
    """
    return ZenohAccess(
        user=zenoh.user,
        password=secret_of("zenoh.password", zenoh.password, zenoh.password_file),
        users_file=zenoh.users_file,
        root_ca=zenoh.tls.root_ca,
        certificate=zenoh.tls.certificate,
        private_key=zenoh.tls.private_key,
        is_mutual=zenoh.tls.mutual,
        verify_name=zenoh.tls.verify_name,
        table=_table(zenoh),
    )


def _table(zenoh: ZenohSettings) -> AccessTable | None:
    if zenoh.access_control is None:
        return None
    if zenoh.access_control != "default":
        return load_access(zenoh.access_control)
    with as_file(files("wetwell.services") / "security" / "access.toml") as file:
        return load_access(file)
