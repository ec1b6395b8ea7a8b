"""`python -m verification error-bound`: bounds of s and e while the TDE error is bounded."""

from verification.error_bound import command
from verification.error_dynamics.model import ErrorDynamicsError

ERRORS = (ErrorDynamicsError,)
add_arguments = command.add_arguments
run = command.run
