"""A checkpoint that is not what was written is refused, whichever of its bytes has changed."""

import hashlib
import json
import random

from wetwell.detector.detector import Detector
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.detector.checkpoint import Told, checkpoint_in, is_intact


def test_no_bit_of_a_checkpoint_can_flip_unseen(alpha, tmp_path, caplog):
    verdict = Verdict(
        time=5, station="alpha", pump=1, state="normal", probability={}, evidence={"steady": 123456}, window=(1, 5)
    )
    checkpoint_in(tmp_path, "alpha").save(Detector.of(alpha), Told({"order-1": verdict}, [verdict.encode()]))
    path = tmp_path / "alpha.detector.json"
    content = path.read_bytes()
    assert is_intact(content)
    assert checkpoint_in(tmp_path, "alpha").restore(Detector.of(alpha)).verdicts == [verdict.encode()]
    dice = random.Random(1)
    head = content.index(b"\n")
    for place in [dice.randrange(head) for _ in range(150)] + [
        dice.randrange(head, len(content) - 1) for _ in range(50)
    ]:
        changed = bytearray(content)
        changed[place] ^= 1 << dice.randrange(7)
        path.write_bytes(changed)
        assert not is_intact(bytes(changed)), place
        assert checkpoint_in(tmp_path, "alpha").restore(Detector.of(alpha)) is None, place
    assert "kept as alpha.detector.refused" in caplog.text


def test_verdicts_of_earlier_versions_are_told_as_well(alpha, tmp_path):
    verdict = Verdict(time=5, station="alpha", pump=1, state="normal", probability={}, evidence={}, window=(1, 5))
    checkpoint_in(tmp_path, "alpha").save(Detector.of(alpha), Told({}))
    path = tmp_path / "alpha.detector.json"
    head, _, snapshot = path.read_bytes().partition(b"\n")
    header = json.loads(head) | {"verdicts": [verdict.model_dump(mode="json")]}
    del header["sha256"], header["given_up"]
    header["sha256"] = hashlib.sha256(json.dumps(header, sort_keys=True).encode() + snapshot).hexdigest()
    path.write_bytes(json.dumps(header).encode() + b"\n" + snapshot)
    assert checkpoint_in(tmp_path, "alpha").restore(Detector.of(alpha)).verdicts == [verdict.encode()]
