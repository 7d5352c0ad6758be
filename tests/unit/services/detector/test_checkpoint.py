"""A checkpoint that is not what was written is refused, whichever of its bytes has changed."""

import random

from wetwell.detector.detector import Detector
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.detector.checkpoint import Told, checkpoint_in, is_intact


def test_no_bit_of_a_checkpoint_can_flip_unseen(alpha, tmp_path, caplog):
    verdict = Verdict(
        time=5, station="alpha", pump=1, state="normal", probability={}, evidence={"steady": 123456}, window=(1, 5)
    )
    checkpoint_in(tmp_path, "alpha").save(Detector.of(alpha), Told({"order-1": verdict}, [verdict]))
    path = tmp_path / "alpha.detector.json"
    content = path.read_bytes()
    assert is_intact(content)
    assert checkpoint_in(tmp_path, "alpha").restore(Detector.of(alpha)).verdicts == [verdict]
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
