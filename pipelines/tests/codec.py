"""A second decoder of the frames of live views, from docs/protocol.md and docs/codec.md: python codec.py < BLOCKS > ARRAYS. Each block
is a message. Of each come a line of text; triangles, features and lines (32 bits) where it has a topology; positions; names and values."""
import bisect, collections, io, itertools, sys, types, numpy as np

NEAR, COARSEST, LEVELS, LIST, WHOLE = 8, 48, 24, 32, np.float32(12582912)
CONTEXT, EDGES = np.array([9, 7, 6, 5, 4, 4], "f4"), [1, 3, 5, 8, 12, 17, 25, 35, 49, 70, 101, 145, 232, 377, 638, 1160]
FIRST_TABLES = [2, 7, 9, 10, 11, 11, 12, 14, 15, 16, 18, 19, 20, 21, 23, 25, 28]

class Input(io.BytesIO):
    def array(self, kind, length): return np.frombuffer(self.read(np.dtype(kind).itemsize * length), kind)
    def one(self, kind): return self.array(kind, 1).item()
    def count(self): return byte & 127 | self.count() << 7 if (byte := self.one("u1")) > 127 else byte
    def block(self): return self.read(self.count())

class Bits:  # A model has a name; it is the probability of a no, and the number of decisions seen.
    def __init__(self, data):
        self.bytes, self.models = itertools.chain(data, itertools.repeat(0)), collections.defaultdict(lambda: (32768, 0))
        self.code, self.range = int.from_bytes(itertools.islice(self.bytes, 4), "big"), 2**32 - 1
    def narrow(self, start, size):  # Goes on with this part of the range.
        self.code, self.range = self.code - start, size
        while self.range < 1 << 24: self.code, self.range = self.code << 8 | next(self.bytes), self.range << 8
    def bit(self, *name):
        no, seen = self.models[name]
        bound, rate = (self.range >> 16) * no, 65536 // (seen + 2)
        is_yes = self.code >= bound
        self.narrow(*((bound, self.range - bound) if is_yes else (0, bound)))
        no += -(no * rate >> 16) if is_yes else (65536 - no) * rate >> 16
        self.models[name] = min(max(no, 64), 65472), min(seen + 1, 23)
        return is_yes
    def number(self, *name):  # Its length, and the bits below the highest.
        node, value = 1, 1
        for _ in range(7): node = node << 1 | self.bit(*name, node)
        if node == 128: return 0
        for part in [16] * ((node - 129) // 16) + [(node - 129) % 16]:
            size = self.range >> part
            bits = min(self.code // size, (1 << part) - 1)
            self.narrow(bits * size, size)
            value = value << part | bits
        return value
def unzigzag(number): return number >> 1 ^ -(number & 1)

def sides(triangles): return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
def join(*ring):  # Makes gates neighbours, each of the next.
    for gate, after in zip(ring, ring[1:]): gate.after, after.before = after, gate

class Topology:
    def __init__(self, message):
        points, _, lines, self.has_features = message.count(), message.count(), message.count(), message.one("u1")
        step, offset, self.bits = message.one("<f8"), message.array("<f8", 3), Bits(message.read())
        self.places, self.triangles, self.features, self.lines, self.degree, self.was_new = [], [], [], [], collections.Counter(), False
        while self.bits.bit("more"):
            a, b, c = (self.point(self.last(), "seed", corner) for corner in range(3))
            self.line = []
            join(*self.add([a, b, c], None, [(b, a, c), (a, c, b), (c, b, a)]), self.line[0])
            for gate in (gate for gate in self.line if gate.is_open): self.cross(gate, gate.start, gate.end, gate.before, gate.after)
        for line in range(lines):
            first = self.lines[-1][1] if line and self.bits.bit("goes on") else self.point(self.last(), "end")
            self.lines.append([first, self.point(self.places[first], "end")])
        while len(self.places) < points: self.new(self.last())
        places, triangles = (np.array(rows, int).reshape(-1, 3) for rows in (self.places, self.triangles))
        self.points = Hierarchy(places, sides(triangles) + self.lines)
        self.triangles, self.lines = (self.points.place_of[cells] for cells in (triangles, np.array(self.lines, int).reshape(-1, 2)))
        self.places, self.positions = places[self.points.order], offset + step * places[self.points.order]
        centres = [self.places[self.triangles].sum(1), (1.5 * self.places[self.lines].sum(1)).astype(int)]
        shared = [(sorted(side), index // 3) for index, side in enumerate(sides(self.triangles))]
        shared += [([end, 1 << 32], len(triangles) + index // 2) for index, end in enumerate(self.lines.flat)]
        self.elements = Hierarchy(np.concatenate(centres), [(a[1], b[1]) for a, b in itertools.pairwise(sorted(shared)) if a[0] == b[0]])
    def last(self): return self.places[-1] if self.places else np.zeros(3, int)
    def old(self, kind): return len(self.places) - 1 - self.bits.number(kind)
    def point(self, near, kind, *corner): return self.new(near) if self.bits.bit(kind, "new", *corner) else self.old(kind)
    def new(self, near, axes="other"):
        self.places.append(near + [unzigzag(self.bits.number(axes, axis)) for axis in range(3)])
        return len(self.places) - 1
    def add(self, triangle, beside, gates):  # Takes a triangle up, and makes its gates.
        self.triangles.append(triangle)
        self.degree.update(triangle)
        is_same = self.has_features and beside is not None and self.bits.bit("same feature")
        if self.has_features: self.features.append(self.features[beside] if is_same else self.bits.number("feature"))
        made = [types.SimpleNamespace(start=x, end=y, opposite=o, triangle=len(self.triangles) - 1, is_open=True) for x, y, o in gates]
        self.line += made
        return made
    def cross(self, gate, x, y, before, after):  # Finds what is behind a gate.
        gate.is_open, bits = False, self.bits
        b, a = before.start if before.is_open else None, after.end if after.is_open else None
        context = 40 * min(self.degree[x], 9) + 4 * min(self.degree[y], 9) + 2 * self.was_new + (a == b)
        is_new = self.was_new = bits.bit("new", context)
        is_before = not is_new and b is not None and bits.bit("before", context)
        is_after = not is_new and a is not None and (a == b if is_before else bits.bit("after", context))
        is_old = not (is_new or is_before or is_after)
        if is_old and bits.bit("nothing"): return
        if is_new: k = self.new(self.places[x] + self.places[y] - self.places[gate.opposite], "other" if gate.opposite == x else "third")
        else: k = self.old("known") if is_old else b if is_before else a
        split = next((last for last in reversed(self.line) if last.start == k), None) if is_old else None
        made = self.add([x, y, k], gate.triangle, [(x, k, y)] * (not is_before) + [(k, y, x)] * (not is_after))
        join(gate, *made, after)
        for closed in [gate] + [before] * is_before + [after] * is_after:
            closed.is_open = False
            join(closed.before, closed.after)
        for pair in ((made[0], split), (split.before, made[1])) if split and split.is_open else (): join(*pair)

class Hierarchy:  # The order, and for each place eight places before it and their weights.
    def __init__(self, places, edges):
        points, levels = list(range(len(places))), []
        while len(points) > COARSEST and len(levels) < LEVELS:
            near, kept, owner, colours = [set() for _ in points], {}, [], [0] * len(points)
            for a, b in edges: near[a], near[b] = near[a] | {b}, near[b] | {a}
            near = [sorted(others - {p})[:LIST] for p, others in enumerate(near)]
            for p, others in enumerate(near): owner.append(kept.setdefault(next((q for q in others if q in kept), p), len(kept)))
            for p, others in enumerate(near):
                if p not in kept: colours[p] = min(set(range(1, LIST + 2)) - {colours[q] for q in others})
            levels.append((near, points, colours))
            edges, points = {(owner[p], owner[q]) for p, others in enumerate(near) for q in others}, [points[p] for p in kept]
        earlier = {point: points[max(0, index - COARSEST):index] for index, point in enumerate(points)}
        for near, points, colours in reversed(levels):
            for p in sorted(np.flatnonzero(colours), key=colours.__getitem__):
                earlier[points[p]] = [points[q] for n in near[p] for q in [n] + near[n] if colours[q] < colours[p]]
        near = [sorted(set(others), key=lambda q: (square(places[q], places[p]), q))[:NEAR] for p, others in earlier.items()]
        stencils = [(others + others[:1] * NEAR)[:NEAR] or [p] * NEAR for p, others in zip(earlier, near)]
        self.order, self.place_of = np.array(list(earlier), int), np.argsort(list(earlier))
        self.stencils = self.place_of[np.array(stencils, int).reshape(-1, NEAR)]
        self.weights = kriging(places[self.order], places[self.order][self.stencils.T], np.array([len(others) for others in near], int))

def square(a, b): return ((a - b).astype(float) ** 2).sum(-1)
def kriging(places, near, counts):  # For all places at once. The right sides are rows below the matrix, and become u and v.
    squares, is_there = square(near, places), np.arange(NEAR)[:, None] < counts
    mean = sum(np.sqrt(squares) * is_there) / counts
    def covariance(square): return 64 - np.sqrt(square) / mean * np.sqrt(np.sqrt(square) / mean)
    matrix = np.concatenate([covariance(square(near[:, None], near)) * is_there[:, None], [covariance(squares) * is_there, is_there]])
    matrix[range(NEAR), range(NEAR)] = 64 + 0.02
    is_equal = (counts < 2) | (mean <= 0)
    for k in range(NEAR):
        is_equal |= ~(matrix[k, k] >= 1e-9)
        matrix[k, k] = np.sqrt(matrix[k, k])
        matrix[k + 1:, k] /= matrix[k, k]
        matrix[k + 1:, k + 1:] -= matrix[k + 1:, None, k] * matrix[k + 1:NEAR, k]
    u, v = matrix[NEAR:]
    weights = u + (1 - sum(v * u)) / sum(v * v) * v
    for i in reversed(range(NEAR)):
        for k in range(i + 1, NEAR): weights[i] -= matrix[k, i] * weights[k]
        weights[i] /= matrix[i, i]
    return np.where(is_equal, is_there / np.maximum(counts, 1), weights).T.astype("f4")

TOKENS = [(number, 0) for number in range(32)] + [(2 + half << bits, bits) for bits in range(4, 31) for half in (0, 1)] + [(0, 32)]
def power(base, exponents):  # By repeated squaring.
    result = np.ones(len(exponents))
    for bit in range(34): result, base = np.where(exponents >> bit & 1, result * base, result), base * base
    return result
def probabilities(width):  # Of the tokens.
    (least, plain), ratio = np.array(TOKENS).T, width / (1 + width)
    def tail(numbers): return (power(ratio, numbers - 1) + power(ratio, numbers + 1)) / 2
    single = (power(ratio, least - 1 | 1) - power(ratio, (least - 1 | 1) + 2)) / 2
    return np.where(plain > 0, tail(least) - tail(least + (1 << plain)), np.where(least > 0, single, 1 - ratio))
def table(width):  # How many of 4096 slots come before each token, and all.
    frequencies = np.append(np.floor((15 * probabilities(width) + probabilities(4 * width + 0.02))[:86] / 16 * 4096 + 0.5), 1).astype(int)
    frequencies[frequencies.argmax()] += 4096 - frequencies.sum()
    return [0, *np.cumsum(frequencies).tolist()]
TABLES = [table(width) for width in np.cumprod([1 / 256] + [np.sqrt(2)] * 39)]

class Field:  # What is known of a field: `nodes` has r, r₁, r₂ and d of each component and place.
    def __init__(self, of, components): self.of, self.components, self.size = of, components, len(of.order)
    def decode(self, message):
        flags = message.one("u1")
        if flags & 3 == 0: return np.tile(message.array("<f8", self.components), (self.size, 1))
        if flags & 3 == 1: return self.on_grid(message, flags)
        last = self.values if flags & 4 else [None] * self.components
        self.values = [self.exact(Bits(message.block()), 4 << (flags & 1), values) for values in last]
        return np.stack(self.values, 1)
    def exact(self, bits, size, last):  # One component; `size` is that of a value, in bytes.
        values, numbers, sign = np.zeros(self.size), [0] * self.size, 1 << 8 * size - 1
        def ordered(bits): return bits ^ sign - 1 if bits < 0 else bits
        for p, (near, weights) in enumerate(zip(self.of.stencils, self.of.weights.astype(float))):
            guess = last[p] if last is not None else np.cumsum([0, *(weights * values[near])[weights != 0]])[-1]
            guess = np.array(guess if np.isfinite(guess) else 0, f"<f{size}").view(f"<i{size}").item()
            numbers[p] = bits.number((numbers[near[0]].bit_length() + 7) // 8)
            value = (ordered(guess) + unzigzag(numbers[p]) + sign) % (2 * sign) - sign
            values[p] = np.array(ordered(value), f"<i{size}").view(f"<f{size}")
        return values
    def on_grid(self, message, flags):
        exponent, step = message.one("<i2"), np.float32(message.one("u1"))
        if flags & 4: self.nodes[:, :, 1:3] = self.nodes[:, :, :2] * np.float32(2.0 ** (self.exponent - exponent))
        else:
            self.offsets = message.array("<f4", self.components).astype(float)
            self.nodes, self.tables = np.zeros((self.components, self.size, 4), "f4"), [FIRST_TABLES.copy() for _ in self.offsets]
        if not flags & 8: self.tuples, self.mask = [self.offsets], np.zeros(self.size, int)
        header = message.one("u1") if flags & 16 else 0
        for number in range(1, (header & 7) + 1):
            self.tuples.append(np.zeros(self.components) if header >> 2 + number & 1 else message.array("<f8", self.components))
            bits = Bits(message.block())
            for p in np.flatnonzero(self.mask == 0): self.mask[p] = number * bits.bit((self.mask[self.of.stencils[p, :4]] == number).sum())
        self.exponent, is_set, of_mask = exponent, self.mask > 0, np.array(self.tuples)[self.mask]
        r = (of_mask - self.offsets) * 2.0 ** -exponent
        self.nodes[:, is_set, 0] = np.where(abs(r) <= 1 << 23, np.rint(r), 0)[is_set].T
        self.nodes[:, is_set, 3] = 0
        for component in range(self.components): self.component(message, component, step)
        if not flags & 4: self.nodes[:, :, 1] = self.nodes[:, :, 0]  # So that both are the same in the second frame.
        values = np.where(is_set[:, None], of_mask, self.offsets + self.nodes[:, :, 0].T.astype(float) * 2.0 ** exponent)
        exceptions = [(message.count() + 1, message.one("<f8")) for _ in range(message.count() if flags & 32 else 0)]
        values.flat[np.cumsum([gap for gap, _ in exceptions], dtype=int) - 1] = [value for _, value in exceptions]
        return values
    def component(self, message, component, step):  # The differences of one component, in steps.
        nodes, tables, flags = self.nodes[component], self.tables[component], message.one("u1")
        modes = message.read(-(-self.size // 1024)) if flags & 32 else bytes([85 * (flags >> 3 & 3)] * self.size)
        ways = np.array([(0, 1, 0, 0), (0, 0, 0, 0), (1, 0, 0, 0), message.array("i1", 4) / 32 if flags & 64 else [0] * 4], "f4")
        changed = message.count() if flags & 4 else 0
        for context in range(17): tables[context] = message.one("u1") if changed >> context & 1 else tables[context]
        states = collections.deque(message.array("<u4", 1 << (flags & 3)).tolist())
        words, plain = iter(message.array("<u2", message.count()).tolist()), int.from_bytes(message.block(), "little")
        for p in np.flatnonzero(self.mask == 0):
            near, state = nodes[self.of.stencils[p]], states.popleft()
            context = CONTEXT @ near[:6, 3] + 20 * nodes[p, 3] + (12 * self.nodes[component - 1, p, 3] if component else 0)
            table = TABLES[tables[np.searchsorted(EDGES, context, "right")]]
            token = bisect.bisect(table, state & 4095) - 1
            state = (table[token + 1] - table[token]) * (state >> 12) + (state & 4095) - table[token]
            states.append(state if state >> 16 else state << 16 | next(words))
            least, length = TOKENS[token]
            k, plain = unzigzag(least + (plain & (1 << length) - 1)), plain >> length
            now, before, earlier = np.cumsum(self.of.weights[p, :, None] * near[:, :3], axis=0)[-1]
            (a, b, c, d), (last, second) = ways[modes[p // 1024] >> p // 256 % 4 * 2 & 3], nodes[p, 1:3]
            guess = last + a * (now - before) + b * (now - last) + c * (last - second) + d * (before - earlier)
            nodes[p, [0, 3]] = (guess + WHOLE) - WHOLE + step * np.float32(k), min(abs(k), 64)
        assert next(words, None) is None and set(states) == {1 << 16}

class Motion:  # The positions of a mesh that moves.
    def __init__(self, topology): self.topology, self.now, self.free = topology, topology.positions, Field(topology.points, 3)
    def decode(self, message):
        kind = message.one("u1")
        if kind == 2: self.start, self.by = (here + Field(self.topology.points, 3).decode(message) for here in (self.now, 0))
        if kind in (1, 2): self.now = self.start + (message.one("<f8") if kind == 1 else 1) * self.by
        if kind == 3: self.now = self.topology.positions + self.free.decode(message)
        return self.now

def decode(message, views):  # A message; `views` has the topology of each view, and its chain.
    new = Topology(Input(message.block())) if message.read(8) == b"TMBL\2\2\0\0" else None
    name, identity, number = message.block().decode(), message.one("<u8"), message.count()
    yield f"{name}|{identity}|{number}|{message.one('<u8')}|{message.one('<f8')}\n".encode()
    if new: yield from (np.array(cells, "<u4") for cells in (new.triangles, new.features, new.lines))
    view = views[name] = new or views[name]
    if number == 0: view.fields, view.movements = [], (Motion(view), Field(view.points, 3))
    yield view.movements[message.one("u1")].decode(message)
    for index in range(message.count()):
        if number == 0: view.fields.append((message.block(), Field(view.elements if message.one("u1") else view.points, message.count())))
        name, field = view.fields[index]
        values = field.decode(message)
        yield from (name + b"\n", values if field.of is view.points else values[field.of.place_of])
    assert not message.read()

np.seterr(all="ignore")  # NaN and infinity are values like others.
messages, known = Input(sys.stdin.buffer.read()), {}
while messages.tell() < len(messages.getbuffer()):
    for array in decode(Input(messages.block()), known): sys.stdout.buffer.write(bytes(array))
