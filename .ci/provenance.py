"""Sign what a release holds with a key of one's own, and check it: in-toto statement, SLSA provenance, DSSE envelope.

    python .ci/provenance.py sign KEY.pem STATEMENT.json FILE ... [--image NAME@sha256:DIGEST]
    python .ci/provenance.py verify PUBLIC.pem STATEMENT.json FILE ... [--image NAME@sha256:DIGEST]

The key is a private key in PEM without a password, ed25519, ECDSA or RSA. `verify` needs the public one and nothing
else. Exit code 0 if all that is given is what was signed, 1 with a line for each that is not.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.serialization import load_pem_private_key, load_pem_public_key
from securesystemslib.dsse import Envelope
from securesystemslib.exceptions import FormatError, VerificationError
from securesystemslib.signer import CryptoSigner, SSlibKey

ROOT = Path(__file__).parents[1]
PAYLOAD_TYPE = "application/vnd.in-toto+json"
PINS = ("requirements/build.txt", "requirements/fleet.txt", "docker/Dockerfile")
"""Files that say what goes into a release."""

Digests = Mapping[str, str]
"""SHA-256 by the name of a file or an image."""


def digests_of(files: Sequence[Path], images: Sequence[str]) -> Digests:
    """What is to be signed or checked."""
    found = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
    for image in images:
        name, mark, digest = image.partition("@sha256:")
        if not mark or len(digest) != 64:
            raise ValueError(f"image: got '{image}', must be NAME@sha256:DIGEST")
        found[name] = digest
    return found


def statement_of(subjects: Digests, commit: str, pins: Digests) -> dict[str, Any]:
    """Statement of in-toto that SLSA's provenance of a build by hand belongs to these subjects."""
    definition = {
        "buildType": "urn:wetwell:make-release:1",
        "externalParameters": {"command": "make release"},
        "resolvedDependencies": [
            {"name": "wetwell", "digest": {"gitCommit": commit}},
            *({"name": name, "digest": {"sha256": digest}} for name, digest in pins.items()),
        ],
    }
    return {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": name, "digest": {"sha256": digest}} for name, digest in subjects.items()],
        "predicateType": "https://slsa.dev/provenance/v1",
        "predicate": {"buildDefinition": definition, "runDetails": {"builder": {"id": "urn:wetwell:by-hand"}}},
    }


def signed(statement: dict[str, Any], key_pem: bytes) -> bytes:
    """Envelope, in JSON, with the signature of a private key."""
    envelope = Envelope(json.dumps(statement).encode(), PAYLOAD_TYPE, {})
    envelope.sign(CryptoSigner(load_pem_private_key(key_pem, password=None)))
    return json.dumps(envelope.to_dict(), indent=2).encode()


def faults(envelope: bytes, public_pem: bytes, given: Digests) -> list[str]:
    """What is not as it was signed; empty if all is."""
    try:
        read = Envelope.from_dict(json.loads(envelope))
        read.verify([SSlibKey.from_crypto(load_pem_public_key(public_pem))], 1)
    except VerificationError:
        return ["signature: is not one of this key"]
    except (ValueError, KeyError, TypeError, FormatError):
        return ["statement: is no envelope of DSSE"]
    if read.payload_type != PAYLOAD_TYPE:
        return [f"payload: got '{read.payload_type}', must be '{PAYLOAD_TYPE}'"]
    known = {one["name"]: one["digest"]["sha256"] for one in json.loads(read.payload)["subject"]}
    return [
        f"{name}: {'is not what was signed' if name in known else 'was not signed'}"
        for name, digest in given.items()
        if known.get(name) != digest
    ]


def git(*arguments: str) -> str:
    """What git says of this checkout."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()  # noqa: S603, S607


def sign(key: Path, out: Path, subjects: Digests) -> list[str]:
    """Write a signed statement; why that cannot be done, if so."""
    if git("status", "--porcelain"):
        return ["checkout: has changes that no commit holds"]
    pins = {name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest() for name in PINS}
    statement = statement_of(subjects, git("rev-parse", "HEAD"), pins)
    out.write_bytes(signed(statement, key.read_bytes()))
    return []


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("act", choices=["sign", "verify"])
    parser.add_argument("key", type=Path)
    parser.add_argument("statement", type=Path)
    parser.add_argument("files", type=Path, nargs="*")
    parser.add_argument("--image", action="append", default=[], help="NAME@sha256:DIGEST of an image in a registry")
    arguments = parser.parse_args()
    given = digests_of(arguments.files, arguments.image)
    if not given:
        parser.error("give a file or an --image")
    if arguments.act == "sign":
        found = sign(arguments.key, arguments.statement, given)
    else:
        found = faults(arguments.statement.read_bytes(), arguments.key.read_bytes(), given)
    print("\n".join(found or (f"{name}: is as signed" for name in given)))  # noqa: T201
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
