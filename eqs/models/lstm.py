"""The recurrent cell: an LSTM at every pixel, run over a whole sequence at once."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn import functional

from eqs.models.context import Context

State = tuple[Tensor, Tensor]
# How an open cell starts: input and output gates at 0.82, moved little by what they see.
OPEN_LOGIT, GATE_SHARE = 1.5, 0.1

sigmoid_backward = torch.ops.aten.sigmoid_backward.grad_input
tanh_backward = torch.ops.aten.tanh_backward.grad_input


class LSTMSequence(torch.autograd.Function):
    """The recurrent loop, with everything that is not recurrent moved out of it.

    Autograd through the plain loop keeps a dozen tensors per step and multiplies out the weight
    gradients step by step. Here the input half of the gates, the weight gradients and the gradient
    of the input are one product over all steps each; the loop is left with one product per step.

    Convention: rows of the weight are forget, input, output, candidate; columns are the input
    first, then the previous hidden state. No forget bias, no peephole. The cell is float32 even
    where the gates have half precision, because it accumulates over time.
    """

    @staticmethod
    def forward(
        ctx: Context,
        inputs: Tensor,
        weight: Tensor,
        bias: Tensor,
        hidden: Tensor | None,
        cell: Tensor | None,
    ) -> State:
        """Run inputs (T, P, C) through the cell; returns the hidden and the cell states of all T.

        `hidden` and `cell` (P, C) are the states before the first step, None for zeros.
        """
        steps, _, channels = inputs.shape
        recurrent = weight[:, channels:].t()
        gates = functional.linear(inputs, weight[:, :channels], bias)
        hiddens = torch.empty_like(inputs)
        dtype = torch.promote_types(inputs.dtype, torch.float32)
        cells = torch.empty_like(inputs, dtype=dtype)
        before, memory = hidden, cell
        for step in range(steps):
            if before is not None:
                gates[step].addmm_(before, recurrent)
            gates[step, :, : 3 * channels].sigmoid_()
            forget, enter, leave, candidate = gates[step].split(channels, dim=1)
            torch.mul(enter, candidate.tanh_(), out=cells[step])
            if memory is not None:
                cells[step].addcmul_(forget, memory)
            torch.mul(leave, cells[step].tanh(), out=hiddens[step])
            before, memory = hiddens[step], cells[step]
        ctx.save_for_backward(inputs, weight, hidden, cell, gates, hiddens, cells)
        ctx.set_materialize_grads(False)
        return hiddens, cells

    @staticmethod
    @once_differentiable
    def backward(
        ctx: Context, grad_hiddens: Tensor | None, grad_cells: Tensor | None
    ) -> tuple[Tensor | None, ...]:
        """Walk back in time for the gates, then take every other gradient in one product."""
        inputs, weight, hidden, cell, gates, hiddens, cells = ctx.saved_tensors
        channels = inputs.shape[-1]
        recurrent = weight[:, channels:]
        if grad_hiddens is None:
            grad_hiddens = torch.zeros_like(hiddens)
        grad_gates = torch.empty_like(gates)
        carried = None
        for step in reversed(range(len(inputs))):
            grad_hidden = grad_hiddens[step]
            if step + 1 < len(inputs):
                grad_hidden = torch.addmm(grad_hidden, grad_gates[step + 1], recurrent)
            if grad_cells is not None:
                carried = grad_cells[step] if carried is None else carried + grad_cells[step]
            memory = cells[step - 1] if step else cell
            carried = _step_back(
                grad_hidden, carried, gates[step], cells[step], memory, grad_gates[step]
            )
        flat = grad_gates.flatten(0, 1)
        grad_input_weight = flat.t() @ inputs.flatten(0, 1)
        grad_recurrent = grad_gates[1:].flatten(0, 1).t() @ hiddens[:-1].flatten(0, 1)
        grad_first = None
        if hidden is not None:
            grad_recurrent.addmm_(grad_gates[0].t(), hidden)
            grad_first = grad_gates[0] @ recurrent
        return (
            grad_gates @ weight[:, :channels],
            torch.cat((grad_input_weight, grad_recurrent), dim=1),
            flat.sum(0),
            grad_first,
            None if cell is None else carried,
        )


def _step_back(
    grad_hidden: Tensor,
    grad_cell: Tensor | None,
    gates: Tensor,
    cell: Tensor,
    memory: Tensor | None,
    out: Tensor,
) -> Tensor:
    """Write the gradient of one step's gate logits to `out`, return that of the cell before it."""
    channels = cell.shape[1]
    forget, enter, leave, candidate = gates.split(channels, dim=1)
    to_forget, to_enter, to_leave, to_candidate = out.split(channels, dim=1)
    squashed = cell.tanh()
    sigmoid_backward(grad_hidden * squashed, leave, grad_input=to_leave)
    through = torch.ops.aten.tanh_backward(grad_hidden * leave, squashed)
    grad_cell = through if grad_cell is None else through.add_(grad_cell)
    sigmoid_backward(grad_cell * candidate, enter, grad_input=to_enter)
    tanh_backward(grad_cell * enter, candidate, grad_input=to_candidate)
    if memory is None:
        to_forget.zero_()
    else:
        sigmoid_backward(grad_cell * memory, forget, grad_input=to_forget)
    return grad_cell.mul_(forget)


def compute_dtype(x: Tensor) -> torch.dtype:
    """The number type of matrix products on `x`: autocast's where it is on."""
    kind = x.device.type
    return torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else x.dtype


class ConvLSTM(nn.Module):
    """An LSTM that every pixel runs on its own, with shared weights.

    Published name and parameters (`conv1x1`); the 1x1 convolution on channels-last maps is a
    matrix product.
    """

    def __init__(self, channels: int) -> None:
        """Build for `channels` of input and as many of state."""
        super().__init__()
        self.channels = channels
        self.conv1x1 = nn.Conv2d(2 * channels, 4 * channels, 1)

    @torch.no_grad()
    def start_open(self) -> None:
        """Begin as a squashing function of the input: its own candidates, let in and out.

        With the usual random weights half-closed gates and mixed candidates weaken the signal in
        each of the four stages, and a short training begins with opening the way.
        """
        weight, bias = self.conv1x1.weight.flatten(1), cast(Tensor, self.conv1x1.bias)
        gates, size = 3 * self.channels, self.channels
        weight[:gates] *= GATE_SHARE
        weight[gates:] = torch.eye(size, 2 * size)
        bias.zero_()
        bias[size:gates] = OPEN_LOGIT

    def forward(self, x: Tensor, state: State | None) -> State:
        """Run (T, N, h, w, C) over T; returns hidden and cell states of all steps, same shape."""
        dtype = compute_dtype(x)
        pixels = x.to(dtype).flatten(1, 3)
        weight = self.conv1x1.weight.flatten(1).to(dtype)
        bias = cast(Tensor, self.conv1x1.bias).to(dtype)
        hidden = cell = None
        if state is not None:
            hidden = state[0].to(dtype).reshape(pixels.shape[1:])
            cell = state[1].reshape(pixels.shape[1:])
        with torch.autocast(x.device.type, enabled=False):
            hiddens, cells = LSTMSequence.apply(  # type: ignore[no-untyped-call]
                pixels, weight, bias, hidden, cell
            )
        return hiddens.view(x.shape), cells.view(x.shape)

    def gates(self, x: Tensor, hiddens: Tensor, hidden: Tensor | None) -> tuple[Tensor, ...]:
        """Gate logits (forget, input, output, candidate) of a run of `forward` on `x`.

        Args:
            x: what `forward` got, (T, N, h, w, C).
            hiddens: the hidden states it returned.
            hidden: the hidden state it started from, (N, h, w, C), None for zeros.
        """
        first = torch.zeros_like(hiddens[0]) if hidden is None else hidden.to(hiddens.dtype)
        before = torch.cat((first[None], hiddens[:-1]))
        logits = functional.linear(
            torch.cat((x.to(before.dtype), before), dim=-1),
            self.conv1x1.weight.flatten(1),
            self.conv1x1.bias,
        )
        by_gate: tuple[Tensor, ...] = logits.split(self.channels, dim=-1)
        return by_gate
