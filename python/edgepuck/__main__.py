"""`python -m edgepuck` is the program `edgepuck`."""

import sys

from ._program import main

sys.exit(main())
