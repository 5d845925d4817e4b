"""The front ends without a screen: prompt, scripts, piped lines, plots."""
