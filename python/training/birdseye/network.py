"""The network: convolutions of a sweep seen from above, down to cells of 3.2 m and back to 0.2 m."""

import torch
from grid import CHANNELS, NAMES
from torch import Tensor, nn
from torch.nn import functional as F

# Scores of classes, offset of the centre along x and y (cells), logarithms of length, width and height (metres), and the cosine
# and sine of twice the yaw.
N_CLASSES, N_BOX = len(NAMES), 7
OUTPUTS = N_CLASSES + N_BOX
WIDTHS = (32, 48, 64, 96, 128)


def conv(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    """A convolution with batch norm and ReLU."""
    layer = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class BirdsEye(nn.Module):
    """From [batch, CHANNELS, n, n] to [batch, OUTPUTS, n, n]; n is a multiple of 16."""

    def __init__(self, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__()
        cell, a, b, c, d = widths
        self.cell = conv(CHANNELS, cell, 1)
        self.down1, self.a = conv(cell, a, stride=2), conv(a, a)
        self.down2, self.b = conv(a, b, stride=2), nn.Sequential(conv(b, b), conv(b, b))
        self.down3, self.c = conv(b, c, stride=2), nn.Sequential(conv(c, c), conv(c, c))
        self.down4, self.d = conv(c, d, stride=2), nn.Sequential(conv(d, d), conv(d, d))
        self.up3, self.join3 = conv(d, c, 1), conv(c, c)
        self.up2, self.join2 = conv(c, b, 1), conv(b, b)
        self.up1, self.join1 = conv(b, a, 1), conv(a, a)
        self.head = nn.Conv2d(a, 4 * OUTPUTS, 1)
        nn.init.zeros_(self.head.bias)
        # Scores begin near 0: nearly all cells hold no object.
        with torch.no_grad():
            self.head.bias[: 4 * N_CLASSES] = -5.0

    def forward(self, image: Tensor) -> Tensor:
        a = self.a(self.down1(self.cell(image)))
        b = self.b(self.down2(a))
        c = self.c(self.down3(b))
        d = self.d(self.down4(c))
        c = self.join3(c + twice(self.up3(d), c))
        b = self.join2(b + twice(self.up2(c), b))
        a = self.join1(a + twice(self.up1(b), a))
        # The four outputs of a cell of 0.4 m are those of its quarters.
        return F.pixel_shuffle(self.head(a), 2)


def twice(image: Tensor, like: Tensor) -> Tensor:
    """Each cell of `image` four times, cut to the size of `like`."""
    return F.interpolate(image, scale_factor=2)[..., : like.shape[2], : like.shape[3]]
