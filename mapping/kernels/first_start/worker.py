"""A process that compiles kernels: it reads one a line, and answers each with a line."""

import json
import sys

from lidarium.mapping.kernels.first_start.listed_kernels import compile_kernel


def main() -> None:
    """Compile the kernels named on standard input until it ends.

    A kernel that cannot be compiled so is left to its first call.
    """
    for line in sys.stdin:
        try:
            compile_kernel(json.loads(line))
            answer = "compiled"
        except Exception as error:
            answer = f"left out: {type(error).__name__}"
        print(answer, flush=True)


if __name__ == "__main__":
    main()
