"""Ask the daemon of this container how it is: exit code 0 if it says 200, or has no address to ask."""

import http.client
import os
import sys

TIMEOUT_S = 4.0


def main() -> int:
    """Exit code of the check."""
    host, _, port = os.environ.get("WETWELL_HEALTH__HTTP", "").rpartition(":")
    if not port:
        return 0
    try:
        connection = http.client.HTTPConnection("127.0.0.1" if host == "0.0.0.0" else host, int(port), TIMEOUT_S)  # noqa: S104
        connection.request("GET", "/healthz")
        return int(connection.getresponse().status != http.HTTPStatus.OK)
    except (OSError, http.client.HTTPException) as error:
        print(error, file=sys.stderr)  # noqa: T201
        return 1


if __name__ == "__main__":
    sys.exit(main())
