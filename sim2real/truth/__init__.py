"""Plants that stand for reality in a trial; they share no hydraulics with the simulator that is to be judged."""
