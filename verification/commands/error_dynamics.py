"""`python -m verification error-dynamics`: class, times and certificate of the error dynamics."""

from verification.error_dynamics import command
from verification.error_dynamics.model import ErrorDynamicsError

ERRORS = (ErrorDynamicsError,)
add_arguments = command.add_arguments
run = command.run
