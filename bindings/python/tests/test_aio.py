"""A run from outside in `async` programs."""

import asyncio
import copy
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
import tombolo
from conftest import SQUEEZE, Relay
from tombolo.aio import AsyncOrder


def test_a_run_in_async(solver, run):
    async def work():
        aio = run.aio
        await aio.wait_for(lambda: run.features, 30)
        forecast, status = await asyncio.gather(aio.forecast(SQUEEZE, timeout=60), aio.wait_for_cycle(3, 30))
        assert forecast.outcome == "applied" and status.cycle >= 3
        with pytest.raises(TypeError, match="replaces"):
            await aio.forecast(SQUEEZE, replaces="another")
        order = await aio.order(SQUEEZE)
        await order.wait(60)
        assert order.status == "applied"
        await aio.set("heating", 2, timeout=30)
        with pytest.raises(tombolo.WaitError):
            await aio.wait_for(lambda: False, 0.2)
        task = asyncio.create_task(aio.wait_for(lambda: False))
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        async for event in aio.events("monitor"):
            assert event.data["pipeline"] == "health"
            break
        assert await aio.stack() == run.stack and await aio.pipelines() == run.pipelines
        cut = {"name": "cut", "stages": [{"slice": {"origin": [0.5, 0.5, 0.5], "normal": [1, 0, 0]}}, {"stream": {}}]}
        await aio.change_pipelines({"set": [cut]}, timeout=30)
        assert (await aio.wait_for_view("cut", timeout=30)).name == "cut"
        with pytest.raises(KeyError, match="cut"):
            await aio.wait_for_view("cub", timeout=1)
        # What is told from this call on comes, whenever it is first asked for.
        events = aio.events("order")
        await (await aio.undo()).wait(60)
        assert (await events.__anext__()).data["status"] == "accepted"
        await aio.close()
        assert [event async for event in events] == []

    asyncio.run(work())


def test_what_is_cancelled_before_the_wheel_is_there_is_not_given(solver, monkeypatch):
    with tombolo.connect(solver.link) as other, tombolo.connect(solver.link) as run:
        other.drive()
        run.wait_for(lambda: run.features and run.status.driver, 30)
        ask_for_wheel = run._ask_for_wheel

        def ask_again(until, reconnects):
            # As for a wheel that is kept for one who has left, though this one is there as long as anybody asks.
            try:
                return ask_for_wheel(until, reconnects)
            except tombolo.NotDriverError:
                time.sleep(0.05)
                return False

        monkeypatch.setattr(run, "_ask_for_wheel", ask_again)

        async def give():
            asked = (run.aio.order(SQUEEZE), run.aio.undo(), run.aio.set("heating", 7), run.aio.pause())
            ended = await asyncio.gather(*(asyncio.wait_for(it, 0.3) for it in asked), return_exceptions=True)
            assert all(isinstance(it, asyncio.TimeoutError) for it in ended), ended
            # Whoever went on asking would have the wheel now.
            other.close()

        asyncio.run(give())
        # All its threads have ended, so that nothing can be given any more.
        cycle = run.status.cycle
        run.wait_for_cycle(cycle + 50, 30)
        assert run.orders == [] and not run.status.paused and 7 not in solver.heating


def test_a_forecast_that_is_cancelled_holds_nothing_up(solver):
    relay = Relay(solver.link)

    def let_through():
        relay.swallows = False
        relay.cut()

    # A program that is held up goes on then.
    late = threading.Timer(30.0, let_through)

    async def ask(aio):
        forecast = asyncio.create_task(aio.forecast(SQUEEZE))
        begun = time.monotonic()
        while aio.run._forecasting is None and time.monotonic() < begun + 20:
            await asyncio.sleep(0.01)
        # It waits for the answer now.
        await asyncio.sleep(0.1)
        forecast.cancel()
        with pytest.raises(asyncio.CancelledError):
            await forecast

    async def ask_again(aio):
        relay.swallows = True
        try:
            await asyncio.wait_for(aio.forecast(SQUEEZE), 0.5)
            raise AssertionError("it was answered")
        except asyncio.TimeoutError:
            # While the error of the first is still known.
            let_through()
            assert (await aio.forecast(SQUEEZE, timeout=60)).outcome == "applied"

    try:
        with tombolo.connect(relay.link) as run:
            run.wait_for(lambda: run.features, 30)
            run.drive()
            relay.swallows = True
            late.start()
            begun = time.monotonic()
            asyncio.run(ask(run.aio))
            assert time.monotonic() - begun < 25
            # The next one has its turn.
            let_through()
            assert run.forecast(SQUEEZE, timeout=60).outcome == "applied"
            asyncio.run(ask_again(run.aio))
    finally:
        late.cancel()
        relay.server.close()


def test_forecasts_at_once_are_all_answered(begin):
    running = begin(step=0.02)
    amounts = [0.02 * number for number in range(1, 9)]

    def edits(amount):
        return [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -amount]}}]

    with tombolo.connect(running.link) as run:
        run.wait_for(lambda: run.features, 30)

        async def ask():
            wanted = [run.aio.forecast(edits(amount), timeout=60) for amount in amounts]
            return await asyncio.gather(*wanted)

        of_tasks = asyncio.run(ask())
        with ThreadPoolExecutor(len(amounts)) as pool:
            of_threads = list(pool.map(lambda amount: run.forecast(edits(amount), timeout=60), amounts))
        for foretold in (of_tasks, of_threads):
            assert [forecast["largest_displacement"] for forecast in foretold] == pytest.approx(amounts)


def test_events_go_on_after_one_was_waited_for_in_vain(begin):
    running = begin(step=0.2)
    with tombolo.connect(running.link) as run:

        async def follow():
            events, cycles, waited = run.aio.events("monitor"), [], 0
            while len(cycles) < 5:
                try:
                    cycles.append((await asyncio.wait_for(events.__anext__(), 0.03)).data["cycle"])
                except asyncio.TimeoutError:
                    waited += 1
            return cycles, waited

        cycles, waited = asyncio.run(follow())
    assert waited > 0
    # None is lost.
    assert cycles == list(range(cycles[0], cycles[0] + 5))


def test_an_order_is_cancelled_and_the_block_closes_the_run(begin):
    running = begin(step=900.0)
    with tombolo.connect(running.link) as run:

        async def work():
            async with run.aio as aio:
                await aio.wait_for(lambda: run.features, 30)
                order = await aio.order(SQUEEZE)
                cancelled = asyncio.create_task(order.cancel(timeout=60))
                await asyncio.sleep(0)
                running.step = 0.002
                try:
                    assert (await cancelled).done
                except tombolo.RejectedError as error:
                    # It may have begun by then.
                    assert order.id in str(error)

        asyncio.run(work())
        assert not run.connected


def test_many_waits_hold_no_threads(run):
    async def work():
        waits = [asyncio.create_task(run.aio.wait_for(lambda: False, 1.0)) for _ in range(100)]
        waits += [asyncio.create_task(run.aio.events("order").__anext__()) for _ in range(100)]
        begun, threads = time.monotonic(), threading.active_count()
        await asyncio.sleep(0.1)
        held = threading.active_count() - threads
        # Neither a command nor the program's own use of the pool waits for them.
        await run.aio.set("heating", 4, timeout=30)
        await asyncio.to_thread(time.monotonic)
        ended = await asyncio.gather(*waits[:100], return_exceptions=True)
        seconds = time.monotonic() - begun
        [wait.cancel() for wait in waits]
        await asyncio.gather(*waits, return_exceptions=True)
        return held, seconds, ended

    run.drive()
    held, seconds, ended = asyncio.run(work())
    # With a thread for each, six at a time, it took seventeen seconds.
    assert held <= 0 and seconds < 10, (held, seconds)
    assert all(isinstance(error, tombolo.WaitError) and "1.0 seconds" in str(error) for error in ended)
    assert run._reader._tells == []


def test_a_loop_that_ends_waits_for_no_thread(solver):
    relay = Relay(solver.link)

    async def ask(run):
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(run.aio.surface(), 0.2)

    with tombolo.connect(relay.link) as run:
        run.wait_for(lambda: run.features, 30)
        relay.swallows = True
        begun = time.monotonic()
        asyncio.run(ask(run))
        assert time.monotonic() - begun < 3
        relay.swallows = False
        relay.cut()
    relay.server.close()


def displacements(tmp_path):
    """An order whose displacements are in a file that somebody is about to write."""
    file = tmp_path / "lift.txt"
    os.mkfifo(file)
    return file, [{"displacement": {"file": str(file)}}]


def write(file):
    """Once somebody reads it."""
    file.write_text("x, y, z, dx, dy, dz\n0, 0, 1, 0, 0, 0.01\n")


def nothing_is_given(run):
    cycle = run.status.cycle
    run.wait_for_cycle(cycle + 50, 30)
    return run.orders == []


def test_an_order_that_is_cancelled_while_its_file_is_read_is_not_given(run, tmp_path):
    run.wait_for(lambda: run.features, 30)
    run.drive()
    file, edits = displacements(tmp_path)

    async def give():
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(run.aio.order(edits), 0.3)
        await asyncio.to_thread(write, file)

    asyncio.run(give())
    assert nothing_is_given(run)


def test_an_order_that_is_interrupted_while_its_file_is_read_is_not_given(run, tmp_path):
    run.wait_for(lambda: run.features, 30)
    run.drive()
    file, edits = displacements(tmp_path)

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        with pytest.raises(KeyboardInterrupt):
            run.order(edits)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    write(file)
    assert nothing_is_given(run)


def test_a_run_is_connected_in_async(solver):
    async def work():
        async with tombolo.aio.connect(solver.link) as aio:
            assert (await aio.wait_for_cycle(1, 30)).cycle >= 1
        assert not aio.run.connected
        aio = await tombolo.aio.connect(solver.adaptor.watching_link, watch=True)
        assert not aio.run.drives
        await aio.close()
        with pytest.raises(tombolo.LinkError, match="refused"):
            await tombolo.aio.connect("http://127.0.0.1:1/?token=abc")

    asyncio.run(work())


def test_orders_of_async_programs_are_cancelled_and_replaced(begin):
    running = begin(step=900.0)
    with tombolo.connect(running.link) as run:

        async def work():
            aio = run.aio
            await aio.wait_for(lambda: run.features, 30)
            first = await aio.order(SQUEEZE)
            assert copy.copy(first).order is first.order and copy.deepcopy([first.id]) == [first.id]
            assert not hasattr(first, "__len__") and not hasattr(AsyncOrder.__new__(AsyncOrder), "order")
            second = await aio.order(SQUEEZE, replaces=first)
            third = run.order(SQUEEZE, replaces=second)
            fourth = await aio.order(SQUEEZE, replaces=third)
            cancelled = asyncio.create_task(aio.cancel(fourth, timeout=60))
            # It may be under way by then.
            running.step = 0.002
            await asyncio.gather(cancelled, return_exceptions=True)
            for order in (first, second):
                with pytest.raises(tombolo.RejectedError, match="replaced by order"):
                    await order.wait(60)
            for ask in (lambda: aio.cancel(3), lambda: aio.order(SQUEEZE, replaces=[first])):
                with pytest.raises(tombolo.ConfigurationError, match="expected an order or its id"):
                    await ask()
            with pytest.raises(tombolo.RejectedError, match=fourth.id):
                run.cancel(fourth, timeout=60)

        asyncio.run(work())


def test_waits_in_vain_and_timeouts_that_are_none(run):
    async def work():
        aio = run.aio
        for ask, text in (
            (lambda: aio.wait_for_cycle(10**9, timeout=0.1), "no step from cycle 1000000000 on was told within 0.1 s"),
            (lambda: aio.wait(timeout=0), "the run did not end within 0 seconds"),
        ):
            with pytest.raises(tombolo.WaitError, match=text):
                await ask()
        for ask in (
            lambda: aio.set("heating", 5, timeout=-1),
            lambda: aio.forecast(SQUEEZE, timeout="soon"),
            lambda: aio.wait(float("nan")),
            lambda: aio.drive(float("nan")),
            lambda: aio.link_for(timeout=-1),
        ):
            with pytest.raises(tombolo.ConfigurationError, match=r"timeout: found .*expected"):
                await ask()

    asyncio.run(work())
    assert run.parameters["heating"].value == 1
