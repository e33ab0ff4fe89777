"""Lets torchvision be imported beside a torch without CUDA, for programs of these tests.

PyPI's torchvision is compiled against CUDA: its own operators cannot be loaded into the CPU build
of torch, and its Python files end in an error where they describe two of them, which no test here
calls. Python imports this file as it starts if its folder is on PYTHONPATH.
"""

import importlib.machinery
import sys
from collections.abc import Sequence
from types import ModuleType

OPERATORS = ("nms", "qnms")


class OperatorFinder:
    def find_spec(
        self, name: str, _path: Sequence[str] | None, _target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Declare operators when torchvision is about to be imported, and find nothing."""
        if name == "torchvision" and not hasattr(self, "library"):
            import torch

            if torch.version.cuda is None:
                self.library = torch.library.Library("torchvision", "DEF")
                for operator in OPERATORS:
                    self.library.define(
                        f"{operator}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor"
                    )
        return None


sys.meta_path.insert(0, OperatorFinder())
