"""What the tests of kernels share."""

from support.kernel_place import place as place
