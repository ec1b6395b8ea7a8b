#ifndef HAL_H
#define HAL_H

/*
 * All that the application asks of a board. A port fills in these functions; app.c stays as it is.
 * "From the tick" means that only the tick interrupt calls it: it must not wait for anything.
 */

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

/* --- The robot ------------------------------------------------------------------------------- */

/**
 * Latches and reads every encoder [count]; from the tick.
 * Counters wrap at 32 bits; a narrower counter has to be extended here.
 * Returns false if an encoder reports an error; the tick then uses no count.
 */
bool hal_read_encoders(int32_t counts[JOINTS]);

/**
 * The set-point of this tick; from the tick. Writes every field of the input except the counts.
 * Returns false if there is none, for example because the fieldbus is silent.
 */
bool hal_read_reference(controller_input *input);

/**
 * What holds the robot where it stands, in the controller's unit of torque: N m, or 2^-T N m in
 * fixed-point. Asked when the brakes are about to open; from the tick. Gravity from a table or a
 * model, or zeros for a balanced robot.
 */
void hal_read_holding_torque(controller_number torque[JOINTS]);

/**
 * Hands the torque at the joints to the drives, in the controller's unit; from the tick, once in
 * every tick.
 */
void hal_write_torque(const controller_number torque[JOINTS]);

/** Engages or opens the brakes; from the tick. */
void hal_set_brakes(bool engaged);

/** The fault output: the line that the cell's safety controller watches; from the tick. */
void hal_set_fault(bool on);

/* --- Time ------------------------------------------------------------------------------------ */

/** Starts the timer that calls the application's tick every SAMPLE_TIME_S. */
void hal_start_ticks(void);

/** Timer counts from tick to tick. */
uint32_t hal_tick_period(void);

/** Timer counts since the tick began; the period or more once the next tick is due. */
uint32_t hal_tick_elapsed(void);

/* --- The main loop --------------------------------------------------------------------------- */

/** Prepares the board; called once, before anything else. */
void hal_init(void);

/** Sleeps until an interrupt. */
void hal_idle(void);

/** The next character from the console, or -1 if there is none. */
int hal_console_read(void);

/** Writes a character to the console; may wait. */
void hal_console_write(char character);

/**
 * Provokes a fault, to see it handled; a port may leave this empty. Keys: o: five ticks are late;
 * j: an encoder jumps; e: an encoder reports an error; x: an instruction that does not exist.
 */
void hal_provoke(char key);

/**
 * Stops the robot when nothing else works any more: fault output on, brakes engaged, torque zero.
 * Called from a processor exception, so it relies on no state of the application.
 */
void hal_emergency_stop(void);

#endif
