"""The motion-blur perception study: stimuli, observers, trials, psychometric functions."""
