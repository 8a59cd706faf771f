"""Typed client in Python: answers are the models of the service, errors are `ServiceError`.

Needs httpx2 (``pip install 'rcsa-ident[client]'``).
"""

from api.client.asking import ServiceError
from api.client.whole import Client

__all__ = ["Client", "ServiceError"]
