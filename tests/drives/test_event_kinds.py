"""Subscribers that take only some kinds of events, and those that fail."""

from multidrop.drives.events import Changed, EventQueue, Notice, Publisher, Silent


def test_a_subscriber_gets_the_kinds_that_it_takes():
    publisher, some, every = Publisher("a test"), [], []
    leave = publisher.subscribe(some.append, Changed, Silent)
    publisher.subscribe(every.append)
    publisher.publish(Changed(1.0))
    publisher.publish(Notice(2.0, "text"))
    publisher.publish(Silent(3.0, "a"))
    leave()
    publisher.publish(Changed(4.0))
    assert [each.at for each in some] == [1.0, 3.0]
    assert [each.at for each in every] == [1.0, 2.0, 3.0, 4.0]


def test_a_kind_is_known_after_a_later_subscription():
    publisher, found = Publisher("a test"), []
    publisher.publish(Changed(1.0))
    publisher.subscribe(found.append, Changed)
    publisher.publish(Changed(2.0))
    assert found == [Changed(2.0)]


def test_a_watcher_that_fails_keeps_no_event_from_the_others():
    queue, found = EventQueue("press"), []

    def fails(event):
        found.append(("first", event.at))
        if event.at == 1.0:
            queue.publish(Changed(3.0))
        raise ValueError

    queue.subscribe(fails)
    queue.subscribe(lambda event: found.append(("second", event.at)))
    queue.collect(Changed(1.0))
    queue.collect(Changed(2.0))
    queue.tell()
    assert found == [(who, at) for at in (1.0, 2.0, 3.0) for who in ("first", "second")]
