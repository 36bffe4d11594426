"""The metric inside somebody else's training: in several processes, and as a loss."""

import re
from dataclasses import replace
from pathlib import Path

import lightning
import numpy as np
import pytest
import torch
from torch import distributed, multiprocessing

from eqs.metrics import EventQualityScore, Judge

PAGE = Path(__file__).parents[2] / "docs" / "metric.md"
PROCESSES = 2


def sequences():
    """Four pairs of histograms of three windows."""
    generator = torch.Generator().manual_seed(0)
    return torch.randint(0, 4, (4, 2, 3, 20, 32, 32), generator=generator, dtype=torch.uint8)


def metric():
    return EventQualityScore(Judge.random(size="tiny", partition_split_32=1), warmup_windows=0)


def score_share(rank, file):
    torch.set_num_threads(1)
    address = {"init_method": f"file://{file}", "rank": rank, "world_size": PROCESSES}
    distributed.init_process_group("gloo", **address)
    shared = metric()
    for simulated, real in sequences()[rank::PROCESSES]:
        shared.update(simulated, real)
    torch.save(shared.compute(), f"{file}.{rank}.pt")
    distributed.destroy_process_group()


def test_processes_agree_on_the_mean_of_what_each_has_seen(tmp_path):
    file = str(tmp_path / "meeting")
    multiprocessing.spawn(score_share, (file,), nprocs=PROCESSES)
    alone = metric()
    for simulated, real in sequences():
        alone.update(simulated, real)
    for rank in range(PROCESSES):
        found = torch.load(f"{file}.{rank}.pt").item()
        assert found == pytest.approx(alone.compute().item(), abs=1e-6)


@pytest.fixture
def moving_dot():
    """(t, x, y, p) of a dot that crosses the sensor in 400 ms."""
    t = torch.arange(1000, 399_000, 100, dtype=torch.float32)
    x = (t * 31 / 400_000).long()
    y = torch.arange(len(t)) % 8 + 12
    return t, x, y, torch.arange(len(t)) % 2


@pytest.mark.filterwarnings("ignore:.*does not have many workers", "ignore:.*LeafSpec.*")
@pytest.mark.filterwarnings("ignore:.*smaller than the logging interval", "ignore:.*in eval mode")
def test_the_example_of_the_documents_learns_a_delay(moving_dot, tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (example,) = (block for block in blocks if "LightningModule" in block)
    made = {"__name__": "document"}
    exec(example, made)
    judge = Judge.random(size="tiny", partition_split_32=1)
    judge = replace(judge, definition=replace(judge.definition, warmup_windows=0))
    module = made["Delay"](judge)
    t, *rest = moving_dot
    with torch.no_grad():
        real = module.histograms((t + 2500.0, *rest))
    data = torch.utils.data.DataLoader([(moving_dot, real)] * 4, batch_size=None)
    quiet = {"enable_progress_bar": False, "enable_model_summary": False, "logger": False}
    trainer = lightning.Trainer(
        accelerator="cpu", max_epochs=1, enable_checkpointing=False, **quiet
    )
    (before,) = trainer.validate(module, data, verbose=False)
    trainer.fit(module, data, data)
    (after,) = trainer.validate(module, data, verbose=False)
    assert module.delay_us.item() > 100
    assert before["eqs"] < after["eqs"] <= 1 + 1e-6
    assert np.isfinite(after["eqs"])
