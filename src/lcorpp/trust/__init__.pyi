from .trust import Trust as Trust, TrustOptions as TrustOptions
