"""Coverage of the generated C by directed tests: every branch, and MC/DC of every decision.

The tests are ``target/directed.c``, one file for all controllers, each of them a sentence of the
header. GCC and gcovr count the branches; clang counts for every condition of a decision whether
two tests differ in nothing else and in the outcome (modified condition/decision coverage).
"""
