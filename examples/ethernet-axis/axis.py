"""Moves the axis and prints its fastest sample."""

from multidrop.script import session

axis = session.drive()
with axis.telemetry(rate=20) as telemetry:
    axis.move(51200)
    axis.wait_for("P>=25600", timeout=10)
    axis.wait()
fastest = max(sample.velocity for sample in telemetry.samples())
print(axis.product, "moved to", axis.position, "with telemetry" if fastest > 10_000 else "without telemetry")
