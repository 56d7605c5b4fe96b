"""VoxNet: a network of three-dimensional convolutions over bit-packed voxel grids."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from reliability.voxel_format import LEAST_SIDE, grid_shape
from reliability.voxel_kernels import fill_grids

N_SYMMETRIES = 8
# What torch calls the instructions, on x86 and on ARM.
_BFLOAT16 = ("avx512_bf16", "amx_bf16", "bf16")
_COLUMN_TYPES = {16: torch.int16, 32: torch.int32, 64: torch.int64}


class Dropout(nn.Module):
    """Dropout whose probability is rounded to 1/256, so that a draw costs one byte.

    On a CPU torch's own takes up to a quarter of the training.

    Parameters
    ----------
    probability : float
    """

    def __init__(self, probability: float) -> None:
        super().__init__()
        self.n_dropped = round(256 * probability)

    def forward(self, inputs: Tensor) -> Tensor:
        """Drop some of the inputs in training, and scale up the others."""
        if not self.training:
            return inputs
        words = torch.empty(-(-inputs.numel() // 8), dtype=torch.int64, device=inputs.device)
        draws = words.random_(-(2**63), None).view(torch.uint8)[: inputs.numel()]
        kept = (draws >= self.n_dropped).to(inputs.dtype) * (256 / (256 - self.n_dropped))
        # The inputs' own layout, whatever it is: another would cost a copy.
        return inputs * torch.as_strided(kept, inputs.shape, inputs.stride())


class FlattenToDouble(nn.Flatten):
    """Flattens, for a layer whose sums shall not depend on how many rows there are."""

    def forward(self, inputs: Tensor) -> Tensor:
        """Flatten all but the first dimension."""
        return super().forward(inputs).double()


class VoxNet(nn.Module):
    """The paper's network for the rope, with the dropout of the authors' public code.

    Rows of uint8 are grids packed by ``np.packbits``, and are unpacked here, batch by batch.
    Other numbers are no grid: they are laid out one after another, over and over again, until
    they fill a cube.

    Parameters
    ----------
    n_features : int
        Bytes or numbers per row.
    packed : bool
        Whether rows are bit-packed grids.
    pooling : int
        Side of the cubes of cells of which the network sees the mean, in the first channel, or
        the maximum, in the others.
    mixed_precision : bool
        Compute all but the last layer in bfloat16, on devices that have instructions for it.
    augment : bool
        In training, turn each grid about z and mirror it at random.
    """

    rows_per_forward = 64

    def __init__(
        self, n_features: int, packed: bool, pooling: int, mixed_precision: bool, augment: bool
    ) -> None:
        super().__init__()
        if packed:
            self.channels, self.side = grid_shape(n_features)
        else:
            self.channels, self.side, pooling = 1, smallest_side(n_features), 1
        self.pooling = pooling
        self.mixed_precision = mixed_precision
        self.augment = augment and packed
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
            # Of one grid alone torch sums in another order than of several.
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
        """Round weights once instead of at each call, and sum so that batches do not matter."""
        self.head.double()
        if self._in_bfloat16(self.head.weight.device):
            self.layers.to(torch.bfloat16)
        else:
            first = next(i for i, layer in enumerate(self.layers) if isinstance(layer, nn.Flatten))
            self.layers[first] = FlattenToDouble()
            self.layers[first + 1].double()

    def grids(self, rows: Tensor) -> Tensor:
        """Return what the first layer sees of rows, float32 of shape (n, channels, x, y, z)."""
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
    """Tell whether a device has instructions for bfloat16; if not, it is slow."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    has = torch.cpu.get_capabilities()
    return device.type == "cpu" and any(has.get(name, False) for name in _BFLOAT16)


def smallest_side(n_numbers: int) -> int:
    """Return the side of the smallest cube that so many numbers fit in."""
    side = LEAST_SIDE
    while side**3 < n_numbers:
        side += 2
    return side


def unpacked(rows: Tensor, channels: int, side: int, pooling: int) -> Tensor:
    """Unpack and pool rows on the CPU."""
    seen = side // pooling
    grids = np.zeros((len(rows), seen, seen, seen, channels), dtype=np.float32)
    fill_grids(rows.numpy(), channels, pooling, grids)
    return torch.from_numpy(grids).permute(0, 4, 1, 2, 3)


def unpacked_on_device(rows: Tensor, channels: int, side: int, pooling: int) -> Tensor:
    """Unpack and pool rows with tensor operations alone."""
    shifts = torch.arange(7, -1, -1, dtype=torch.uint8, device=rows.device)
    bits = (rows.unsqueeze(-1) >> shifts) & 1
    grids = bits.reshape(-1, channels, side, side, side).float()
    if pooling > 1:
        parts = [nn.functional.avg_pool3d(grids[:, :1], pooling)]
        if channels > 1:
            parts.append(nn.functional.max_pool3d(grids[:, 1:], pooling))
        grids = torch.cat(parts, dim=1)
    return grids.contiguous(memory_format=torch.channels_last_3d)


def transformed(rows: Tensor, channels: int, side: int, draws: Tensor) -> Tensor:
    """Turn each row's grids about z by 90 degrees ``draws % 4`` times, and mirror from 4 on."""
    columns = rows.view(_COLUMN_TYPES[side]).reshape(len(rows), channels, side * side)
    index = _symmetries(side).to(rows.device)[draws]
    moved = columns.gather(2, index[:, None].expand_as(columns))
    return moved.reshape(len(rows), -1).view(torch.uint8)


def _symmetries(side: int) -> Tensor:
    """Return which column of cells comes to each place, shape (8, side * side)."""
    plane = torch.arange(side * side).reshape(side, side)
    turned = [torch.rot90(plane, k) for k in range(4)]
    return torch.stack([p.reshape(-1) for p in (*turned, *(t.T for t in turned))])
