"""A client in Python, typed: what the service answers, as the same nouns; everything else is a `ServiceError`.

Needs httpx2 (``pip install 'rcsa-ident[client]'``).
"""

from api.client.asking import ServiceError
from api.client.whole import Client

__all__ = ["Client", "ServiceError"]
