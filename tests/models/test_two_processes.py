"""Two processes with half a batch each learn what one process learns from the whole."""

import pytest
import torch
from torch import distributed, multiprocessing, nn
from torch.nn.parallel import DistributedDataParallel

from eqs.models import RVTDetector, SyncBatchNorm
from eqs.models.states import of_all_processes, of_this_process
from eqs.models.synchronised import mean_over_processes

PROCESSES = 2


class Step(nn.Module):
    """Loss of one chunk."""

    def __init__(self):
        super().__init__()
        torch.manual_seed(0)
        self.model = RVTDetector("tiny", 3, partition_split_32=1, layer_scale_init=1.0)

    def forward(self, x, labels):
        maps, _ = self.model.backbone.forward_sequence(x.float())
        return self.model.loss([level.flatten(0, 1) for level in maps], labels.flatten(0, 1))


def chunk():
    """Events (T, N, 20, H, W) and labels (T, N, M, 5): the first sample holds most objects."""
    generator = torch.Generator().manual_seed(1)
    x = torch.randint(0, 4, (2, 4, 20, 64, 64), generator=generator, dtype=torch.uint8)
    labels = torch.zeros(2, 4, 3, 5)
    labels[:, :, 0] = torch.tensor([1.0, 30.0, 26.0, 20.0, 14.0])
    labels[:, 0, 1] = torch.tensor([2.0, 50.0, 40.0, 12.0, 24.0])
    labels[:, 3] = 0
    return x, labels


def outcome(step, losses):
    """Loss, gradients and running statistics."""
    losses["loss"].backward()
    gradients = {name: p.grad for name, p in step.named_parameters() if p.grad is not None}
    statistics = {n: b for n, b in step.named_buffers() if n.endswith(("_mean", "_var"))}
    return losses["loss"].detach(), gradients, statistics


def train_share(rank, file):
    torch.set_num_threads(1)
    distributed.init_process_group(
        "gloo", init_method=f"file://{file}", rank=rank, world_size=PROCESSES
    )
    step = SyncBatchNorm.convert(Step())
    x, labels = (each[:, rank::PROCESSES] for each in chunk())
    together = DistributedDataParallel(step)  # averages gradients for as long as it lives
    loss, gradients, statistics = outcome(step, together(x, labels))
    torch.save((mean_over_processes(loss), gradients, statistics), f"{file}.{rank}.pt")
    distributed.destroy_process_group()


def test_two_processes_learn_what_one_does(tmp_path):
    multiprocessing.spawn(train_share, (str(tmp_path / "meeting"),), nprocs=PROCESSES)
    step = Step()
    loss, gradients, statistics = outcome(step, step(*chunk()))
    for rank in range(PROCESSES):
        found = torch.load(tmp_path / f"meeting.{rank}.pt")
        torch.testing.assert_close(found[0], loss, rtol=1e-5, atol=0)
        assert found[1].keys() == gradients.keys()
        for name, gradient in gradients.items():
            assert (found[1][name] - gradient).norm() < 1e-4 * gradient.norm(), name
        for name, value in statistics.items():
            torch.testing.assert_close(found[2][name], value, rtol=1e-4, atol=1e-5)


def test_alone_it_is_a_plain_batch_norm():
    torch.manual_seed(0)
    plain, x = nn.Sequential(nn.BatchNorm2d(3)), torch.randn(4, 3, 5, 6)
    synchronised = SyncBatchNorm.convert(nn.Sequential(nn.BatchNorm2d(3)))
    torch.testing.assert_close(synchronised(x), plain(x))
    torch.testing.assert_close(synchronised[0].running_var, plain[0].running_var)
    assert mean_over_processes(x) is x


@pytest.mark.parametrize("training", [True, False])
def test_conversion_keeps_parameters_and_mode(training):
    model = nn.Sequential(nn.Conv2d(3, 4, 1), nn.Sequential(nn.BatchNorm2d(4))).train(training)
    nn.init.normal_(model[1][0].weight)
    before = {name: value.clone() for name, value in model.state_dict().items()}
    after = SyncBatchNorm.convert(model)
    assert isinstance(after[1][0], SyncBatchNorm)
    assert after[1][0].training is training
    for name, value in after.state_dict().items():
        assert torch.equal(value, before[name])


def keep_and_take_back(rank, file):
    distributed.init_process_group(
        "gloo", init_method=f"file://{file}", rank=rank, world_size=PROCESSES
    )
    own = [(torch.full((2, 3), 10.0 * rank), torch.full((2, 3), 10.0 * rank + 1))]
    kept = of_all_processes(own)
    torch.save((kept, of_this_process(kept)), f"{file}.{rank}.pt")
    distributed.destroy_process_group()


def test_every_process_s_states_are_kept_and_given_back(tmp_path):
    multiprocessing.spawn(keep_and_take_back, (str(tmp_path / "meeting"),), nprocs=PROCESSES)
    for rank in range(PROCESSES):
        kept, own = torch.load(tmp_path / f"meeting.{rank}.pt")
        ((hidden, cell),) = kept
        assert hidden[:, 0].tolist() == [0, 0, 10, 10]
        assert cell[:, 0].tolist() == [1, 1, 11, 11]
        assert own[0][0].tolist() == [[10.0 * rank] * 3] * 2
    # One process that goes on has the whole batch.
    assert of_this_process(kept)[0][0].shape == (4, 3)
    assert of_this_process(None) is of_all_processes(None) is None
