"""What all tests rely on."""

import signal

# A shell ignores the interrupt key for what it starts in the background, and children inherit that; the tests that
# interrupt a sweep would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)
