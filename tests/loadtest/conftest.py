from serving.fakes import doors

__all__ = ["doors"]
