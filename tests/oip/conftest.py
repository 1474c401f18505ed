from oip.real import real
from serving.fakes import doors

__all__ = ["doors", "real"]
