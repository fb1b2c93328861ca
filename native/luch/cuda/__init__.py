"""Luch on CUDA. Importing this needs no GPU; using it needs CuPy, a driver and a device, or raises DeviceError."""

from luch.cuda.device import DeviceError, available

__all__ = ["DeviceError", "available"]
