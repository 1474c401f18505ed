from oip.real import real

__all__ = ["real"]
