"""The recurrent cell against the plain loop, and its hand-written gradient."""

import pytest
import torch

from eqs.models.lstm import ConvLSTM, LSTMSequence

STEPS, PIXELS, CHANNELS = 4, 3, 2


def plain_loop(inputs, weight, bias, hidden, cell):
    hidden = torch.zeros_like(inputs[0]) if hidden is None else hidden
    cell = torch.zeros_like(inputs[0]) if cell is None else cell
    hiddens, cells = [], []
    for x in inputs:
        logits = torch.cat((x, hidden), dim=1) @ weight.T + bias
        forget, enter, leave, candidate = logits.chunk(4, dim=1)
        cell = forget.sigmoid() * cell + enter.sigmoid() * candidate.tanh()
        hidden = leave.sigmoid() * cell.tanh()
        hiddens.append(hidden)
        cells.append(cell)
    return torch.stack(hiddens), torch.stack(cells)


def arguments(with_state):
    shapes = [(STEPS, PIXELS, CHANNELS), (4 * CHANNELS, 2 * CHANNELS), (4 * CHANNELS,)]
    shapes += [(PIXELS, CHANNELS)] * 2 * with_state
    drawn = [torch.randn(shape, dtype=torch.float64, requires_grad=True) for shape in shapes]
    return drawn if with_state else [*drawn, None, None]


@pytest.mark.parametrize("with_state", [True, False])
def test_values_and_gradients_are_those_of_the_plain_loop(with_state):
    torch.manual_seed(1)
    given = arguments(with_state)
    leaves = [x for x in given if x is not None]
    weights = torch.randn(2, STEPS, PIXELS, CHANNELS, dtype=torch.float64)
    found, expected = LSTMSequence.apply(*given), plain_loop(*given)
    for ours, theirs in zip(found, expected, strict=True):
        torch.testing.assert_close(ours, theirs)
    for used in ([0], [1], [0, 1]):
        losses = [sum((run[i] * weights[i]).sum() for i in used) for run in (found, expected)]
        ours, theirs = (torch.autograd.grad(x, leaves, retain_graph=True) for x in losses)
        for gradient, wanted in zip(ours, theirs, strict=True):
            torch.testing.assert_close(gradient, wanted)


def test_gradient_reaches_back_through_carried_states():
    torch.manual_seed(2)
    inputs, weight, bias, hidden, cell = arguments(with_state=True)
    whole = LSTMSequence.apply(inputs, weight, bias, hidden, cell)[0][-1].sum()
    hiddens, cells = LSTMSequence.apply(inputs[:1], weight, bias, hidden, cell)
    rest = LSTMSequence.apply(inputs[1:], weight, bias, hiddens[-1], cells[-1])[0][-1].sum()
    leaves = [inputs, weight, bias, hidden, cell]
    pairs = zip(torch.autograd.grad(whole, leaves), torch.autograd.grad(rest, leaves), strict=True)
    for ours, theirs in pairs:
        torch.testing.assert_close(ours, theirs)


def test_cell_stays_float32_under_autocast():
    cell = ConvLSTM(4)
    with torch.autocast("cpu", torch.bfloat16):
        hiddens, cells = cell(torch.randn(2, 1, 3, 3, 4), None)
    assert hiddens.dtype == torch.bfloat16
    assert cells.dtype == torch.float32


@pytest.mark.parametrize("with_state", [True, False])
def test_gates_explain_the_states(with_state):
    lstm = ConvLSTM(4)
    x = torch.randn(3, 2, 2, 2, 4)
    state = (torch.randn(2, 2, 2, 4), torch.randn(2, 2, 2, 4)) if with_state else None
    with torch.no_grad():
        hiddens, cells = lstm(x, state)
        forget, enter, leave, candidate = lstm.gates(x, hiddens, state[0] if state else None)
    first = state[1] if state else torch.zeros(2, 2, 2, 4)
    before = torch.cat((first[None], cells[:-1]))
    expected = forget.sigmoid() * before + enter.sigmoid() * candidate.tanh()
    torch.testing.assert_close(cells, expected)
    torch.testing.assert_close(hiddens, leave.sigmoid() * cells.tanh())


def test_an_open_cell_passes_its_input_on_from_the_first_step():
    torch.manual_seed(0)
    cell, x = ConvLSTM(24), torch.randn(1, 1, 6, 8, 24)

    def likeness() -> float:
        hidden = cell(x, None)[0].detach()
        return float(torch.corrcoef(torch.stack([hidden.flatten(), x.flatten()]))[0, 1])

    assert likeness() < 0.3
    cell.start_open()
    assert likeness() > 0.9
