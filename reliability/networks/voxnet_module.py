"""The torch module of VoxNet: three-dimensional convolutions over voxel grids."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from reliability.networks.voxel_format import LEAST_SIDE
from reliability.networks.voxel_grids import (
    N_SYMMETRIES,
    transformed,
    unpacked,
    unpacked_on_device,
)

# Torch's names of the instructions that compute in bfloat16, on x86 and on ARM.
_BFLOAT16 = ("avx512_bf16", "amx_bf16", "bf16")


class Dropout(nn.Module):
    """Dropout with a probability in steps of 1/256, so that a draw takes one random byte.

    On a CPU, torch's own dropout takes up to a quarter of the training time.

    Parameters
    ----------
    probability : float
        Of setting a number to zero.
    """

    def __init__(self, probability: float) -> None:
        super().__init__()
        self.n_dropped = round(256 * probability)

    def forward(self, inputs: Tensor) -> Tensor:
        """Set some of the inputs to zero in training, and scale up the others."""
        if not self.training:
            return inputs
        words = torch.empty(-(-inputs.numel() // 8), dtype=torch.int64, device=inputs.device)
        draws = words.random_(-(2**63), None).view(torch.uint8)[: inputs.numel()]
        kept = (draws >= self.n_dropped).to(inputs.dtype) * (256 / (256 - self.n_dropped))
        # In the memory layout of the inputs, as converting between layouts takes a copy.
        return inputs * torch.as_strided(kept, inputs.shape, inputs.stride())


class FlattenToDouble(nn.Flatten):
    """Flattens to float64, so that the next layer's sums depend little on the size of the batch."""

    def forward(self, inputs: Tensor) -> Tensor:
        """Flatten all but the first dimension."""
        return super().forward(inputs).double()


class VoxNetModule(nn.Module):
    """The paper's network for the rope, with the dropout of the authors' public code.

    Rows are kept packed and are turned into grids batch by batch.

    Parameters
    ----------
    n_features : int
        Bytes or numbers per row.
    grid : (int, int) or None
        Channels, and cells a side, of the grids that rows of uint8 hold. None: rows are floats,
        which are repeated until they fill a grid of one channel.
    pooling : int
        Cells are merged into cubes of this many a side, see :func:`unpacked`.
    mixed_precision : bool
        Compute all but the last layer in bfloat16, on devices that have instructions for it.
    augment : bool
        In training, rotate each grid about z and mirror it at random.
    """

    def __init__(
        self,
        n_features: int,
        grid: tuple[int, int] | None,
        pooling: int,
        mixed_precision: bool,
        augment: bool,
    ) -> None:
        super().__init__()
        self.channels, self.side = grid or (1, smallest_side(n_features))
        self.pooling = pooling
        self.mixed_precision = mixed_precision
        self.augment = augment and grid is not None
        seen = self.side // pooling
        self.layers = nn.Sequential(
            nn.Conv3d(self.channels, 32, 5, stride=2),
            nn.LeakyReLU(),
            Dropout(0.2),
            nn.Conv3d(32, 32, 3),
            nn.LeakyReLU(),
            nn.MaxPool3d(2),
            Dropout(0.3),
            nn.Flatten(),
            nn.Linear(32 * (((seen - 5) // 2 - 1) // 2) ** 3, 128),
            nn.ReLU(),
            Dropout(0.4),
        )
        self.layers.to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload]
        self.head = nn.Linear(128, 1)

    def forward(self, rows: Tensor) -> Tensor:
        """Map (n, n_features) rows to (n, 1) logits."""
        if len(rows) == 1 and not self.training:
            # Torch adds in another order for one grid than for several, so it gets two.
            return self(rows.repeat(2, 1))[:1]
        if self.training and self.augment:
            draws = torch.randint(N_SYMMETRIES, (len(rows),)).to(rows.device)
            rows = transformed(rows, self.channels, self.side, draws)
        dtype = next(self.layers.parameters()).dtype
        grids = self.grids(rows).to(dtype)
        automatic = dtype == torch.float32 and self._in_bfloat16(rows.device)
        with torch.autocast(rows.device.type, torch.bfloat16, enabled=automatic):
            hidden = self.layers(grids)
        return self.head(hidden.to(self.head.weight.dtype)).float()

    def for_inference(self) -> None:
        """Convert the weights once and for all.

        To bfloat16 where forward passes would round to it anyhow, else to float64 for the layer
        with the longest sums, so that a row's logit depends little on the other rows.
        """
        self.head.double()
        if self._in_bfloat16(self.head.weight.device):
            self.layers.to(torch.bfloat16)
        else:
            first = next(i for i, layer in enumerate(self.layers) if isinstance(layer, nn.Flatten))
            self.layers[first] = FlattenToDouble()
            self.layers[first + 1].double()

    def grids(self, rows: Tensor) -> Tensor:
        """Turn rows into the first layer's input, float32 of shape (n, channels, x, y, z)."""
        if rows.dtype != torch.uint8:
            repeats = -(-(self.side**3) // rows.shape[1])
            cells = rows.repeat(1, repeats)[:, : self.side**3]
            return cells.reshape(-1, 1, self.side, self.side, self.side)
        if rows.device.type == "cpu":
            return unpacked(rows, self.channels, self.side, self.pooling)
        return unpacked_on_device(rows, self.channels, self.side, self.pooling)

    def _in_bfloat16(self, device: torch.device) -> bool:
        return self.mixed_precision and computes_bfloat16(device)


def computes_bfloat16(device: torch.device) -> bool:
    """Tell whether a device has instructions for bfloat16; without them it is slow."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    has = torch.cpu.get_capabilities()
    return device.type == "cpu" and any(has.get(name, False) for name in _BFLOAT16)


def smallest_side(n_numbers: int) -> int:
    """Return the side of the smallest cube with room for so many numbers."""
    side = LEAST_SIDE
    while side**3 < n_numbers:
        side += 2
    return side
