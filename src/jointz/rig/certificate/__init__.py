"""Certificate of a walking study: simulated people walk its protocol and are analysed like it."""
