"""A checkpoint takes its name only when it reads back."""

import pytest
import torch

from eqs.training import checkpoints
from eqs.training.checkpoints import CompleteCheckpoints


def test_damage_in_writing_keeps_the_one_before(tmp_path, monkeypatch) -> None:
    path, save = tmp_path / "last.ckpt", torch.save
    CompleteCheckpoints().save_checkpoint({"weights": torch.zeros(1000)}, path)

    def damaged(content, place):
        save(content, place)
        written = bytearray(place.read_bytes())
        written[len(written) // 2] ^= 1
        place.write_bytes(bytes(written))

    monkeypatch.setattr(checkpoints.torch, "save", damaged)
    with pytest.raises(OSError, match="read back"):
        CompleteCheckpoints().save_checkpoint({"weights": torch.ones(1000)}, path)
    assert torch.equal(torch.load(path)["weights"], torch.zeros(1000))
    assert list(tmp_path.iterdir()) == [path]
