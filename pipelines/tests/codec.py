"""A second decoder of topologies and fields, written from docs/codec.md with NumPy alone: python codec.py FOLDER

Reads FOLDER/topology and FOLDER/fields (for each field: 0 for points or 1 for elements, the values of a tuple, the frames, each a byte;
then each frame after its length in 32 bits). Writes positions, triangles, features, lines, and every frame to FOLDER/decoded.
"""
import math, struct, sys
from collections import deque
import numpy as np

NEAR, CONTEXT, LEVELS, COARSEST, LIST = 8, [9, 7, 6, 5, 4, 4], 24, 48, 32
EDGES = [1, 3, 5, 8, 12, 17, 25, 35, 49, 70, 101, 145, 232, 377, 638, 1160]
FIRST_TABLES = [2, 7, 9, 10, 11, 11, 12, 14, 15, 16, 18, 19, 20, 21, 23, 25, 28]
F = np.float32

class Input:
    def __init__(self, data): self.data, self.at = data, 0
    def bytes(self, count): self.at += count; return self.data[self.at - count:self.at]
    def take(self, form):
        values = struct.unpack("<" + form, self.bytes(struct.calcsize("<" + form)))
        return values[0] if len(values) == 1 else values
    def count(self):
        byte = self.take("B")
        return byte & 127 | (self.count() << 7 if byte > 127 else 0)
    def block(self): return self.bytes(self.count())
    def doubles(self, count): return np.frombuffer(self.bytes(8 * count), "<f8")

class Bits:  # A model is a list: the probability of a no of 65536, and the decisions seen.
    def __init__(self, data):
        self.data, self.at, self.code, self.range = data, 4, int.from_bytes(data[:4].ljust(4, b"\0"), "big"), 0xFFFFFFFF
    def widen(self):
        while self.range < 1 << 24:
            byte = self.data[self.at] if self.at < len(self.data) else 0
            self.at, self.range, self.code = self.at + 1, self.range << 8, self.code << 8 | byte
    def bit(self, model):
        (no, seen), bound = model, (self.range >> 16) * model[0]
        bit, rate = self.code >= bound, 65536 // (seen + 2)
        if bit: self.code, self.range, no = self.code - bound, self.range - bound, no - (no * rate >> 16)
        else: self.range, no = bound, no + ((65536 - no) * rate >> 16)
        self.widen()
        model[:] = min(max(no, 64), 65536 - 64), min(seen + 1, 23)
        return int(bit)
    def plain(self, count):
        value = 0
        while count > 0:
            part = min(count, 16)
            count, self.range = count - part, self.range >> part
            bits = min(self.code // self.range, (1 << part) - 1)
            self.code, value = self.code - bits * self.range, value << part | bits
            self.widen()
        return value
    def number(self, models):
        node = 1
        for _ in range(7): node = node << 1 | self.bit(models[node])
        return 1 << (node & 127) - 1 | self.plain((node & 127) - 1) if node & 127 else 0

model, number = lambda: [1 << 15, 0], lambda: [[1 << 15, 0] for _ in range(128)]
unzigzag = lambda value: value >> 1 ^ -(value & 1)

def total(values):
    result = 0.0
    for value in values: result += value
    return result

def topology(data):
    message = Input(data)
    points, count, line_count = message.count(), message.count(), message.count()
    has_features, step, offset = message.take("B"), message.take("d"), message.doubles(3)
    bits, places, triangles, features, lines = Bits(data[message.at:]), [], [], [], []
    gates, queue, last_from, degree, was_new = [], deque(), [], [], 0
    axes, seed_new = [[number() for _ in range(3)] for _ in range(2)], [model() for _ in range(3)]
    more, nothing, same_feature, goes_on, new_end = [model() for _ in range(5)]
    seed_point, known, feature, line_end = [number() for _ in range(4)]
    contexts = [[model() for _ in range(400)] for _ in range(3)]

    def new(x, y, o):
        near = [places[x][a] + places[y][a] - places[o][a] for a in range(3)] if places else [0] * 3
        places.append([near[a] + unzigzag(bits.number(axes[bool(places) and o != x][a])) for a in range(3)])
        last_from.append(None), degree.append(0)
        return len(places) - 1
    def old(numbers): return len(places) - 1 - bits.number(numbers)
    def push(gate):  # from, to, gates before and after, point opposite, triangle, whether it is open
        last_from[gate[0]] = len(gates)
        queue.append(len(gates)), gates.append(gate)
        return len(gates) - 1
    def join(*ring):
        for a, b in zip(ring, ring[1:]): gates[a][3], gates[b][2] = b, a
    def add(triangle, beside):
        triangles.append(triangle)
        for point in triangle: degree[point] += 1
        if has_features:
            same = beside is not None and bits.bit(same_feature)
            features.append(features[beside] if same else bits.number(feature))

    while bits.bit(more):
        t = []
        for corner in range(3):
            last = len(places) - 1
            t.append(new(last, last, last) if bits.bit(seed_new[corner]) else old(seed_point))
        add(t, None)
        base = len(gates)
        for i, (x, y, o) in enumerate([(t[1], t[0], t[2]), (t[0], t[2], t[1]), (t[2], t[1], t[0])]):
            push([x, y, base + (i + 2) % 3, base + (i + 1) % 3, o, len(triangles) - 1, True])
        while queue:
            index = queue.popleft()
            x, y, before, after, opposite, beside, is_open = gates[index]
            if not is_open: continue
            gates[index][6] = False
            b = gates[before][0] if before != index and gates[before][6] and gates[before][1] == x else None
            a = gates[after][1] if after != index and gates[after][6] and gates[after][0] == y else None
            c = (min(degree[x], 9) * 10 + min(degree[y], 9)) * 4 + 2 * was_new + (a == b)
            was_new = bits.bit(contexts[0][c])
            is_before = not was_new and b is not None and bits.bit(contexts[1][c])
            is_after = not was_new and a is not None and (a == b if is_before else bits.bit(contexts[2][c]))
            if not (was_new or is_before or is_after) and bits.bit(nothing): continue
            k = new(x, y, opposite) if was_new else b if is_before else a if is_after else old(known)
            add([x, y, k], beside)
            split, this = last_from[k], len(triangles) - 1
            if was_new or is_before or is_after or (split is not None and not gates[split][6]): split = None
            first = None if is_before else push([x, k, before, after, y, this, True])
            second = None if is_after else push([k, y, before, after, x, this, True])
            if is_before: gates[before][6] = False
            if is_after: gates[after][6] = False
            if is_before and is_after: join(gates[before][2], gates[after][3])
            elif is_before:
                beyond = gates[before][2]
                join(second if beyond == index else beyond, second, second if after == before else after)
            elif is_after:
                beyond = gates[after][3]
                join(first if before == after else before, first, first if beyond == index else beyond)
            else:
                before, after = second if before == index else before, first if after == index else after
                if split is None: join(before, first, second, after)
                elif split == after: join(before, first, after), join(second, second)
                else:
                    into = gates[split][2]
                    join(before, first, split), join(into, second, after)
    for _ in range(line_count):
        if lines and bits.bit(goes_on): a = lines[-1][1]
        else: a = new(*[len(places) - 1] * 3) if bits.bit(new_end) else old(line_end)
        lines.append([a, new(a, a, a) if bits.bit(new_end) else old(line_end)])
    while len(places) < points: new(*[len(places) - 1] * 3)
    assert len(triangles) == count
    of_triangle = lambda a, b, c: ([a, b], [b, c], [c, a])
    of_points = hierarchy(places, [s for t in triangles for s in of_triangle(*t)] + lines)
    place_of = np.argsort(of_points[0])
    triangles, lines = [[[int(place_of[p]) for p in cell] for cell in cells] for cells in (triangles, lines)]
    places = [places[p] for p in of_points[0]]
    centres = [[sum(places[p][a] for p in t) for a in range(3)] for t in triangles]
    centres += [[s + int(s / 2) for s in (places[p][a] + places[q][a] for a in range(3))] for p, q in lines]
    shared = sorted([(sorted(s), i) for i, t in enumerate(triangles) for s in of_triangle(*t)]
                    + [([p, 1 << 32], len(triangles) + i) for i, line in enumerate(lines) for p in line])
    of_elements = hierarchy(centres, [[a[1], b[1]] for a, b in zip(shared, shared[1:]) if a[0] == b[0]])
    return of_points, of_elements, offset + step * np.array(places, float).reshape(-1, 3), triangles, features, lines

def graph(count, edges):
    lists = [set() for _ in range(count)]
    for a, b in edges: lists[a].add(b), lists[b].add(a)
    return [sorted(of - {point})[:LIST] for point, of in enumerate(lists)]

def hierarchy(places, edges):  # The order of the points; of each the places it is predicted from, and their weights.
    of, points, levels = graph(len(places), edges), list(range(len(places))), []
    while len(points) > COARSEST and len(levels) < LEVELS:
        owner, kept, colours = [None] * len(points), {}, [0] * len(points)
        for p in range(len(points)):
            first = next((q for q in of[p] if q in kept), p)
            if first == p: kept[p] = len(kept)
            owner[p] = kept[first]
        for p in range(len(points)):
            used = {0} | {colours[q] for q in of[p]}
            if p not in kept: colours[p] = min(next(c for c in range(65) if c not in used), 63)
        levels.append((of, points, colours))
        of = graph(len(kept), [(owner[p], owner[q]) for p in range(len(points)) for q in of[p]])
        points = [points[p] for p in kept]
        if len(points) == len(levels[-1][1]):
            levels.pop()
            break
    order, place_of, stencils, all_weights = [], {}, [], []
    square = lambda p, q: total((places[p][a] - places[q][a]) * float(places[p][a] - places[q][a]) for a in range(3))
    def push(point, earlier):
        near = sorted((square(other, point), other) for other in set(earlier))[:NEAR]
        found = weights([p for _, p in near], [s for s, _ in near], square)
        pad = NEAR - len(near)
        stencils.append([place_of[p] for _, p in near] + [place_of[near[0][1]] if near else 0] * pad)
        all_weights.append(found + [0.0] * pad)
        place_of[point] = len(order)
        order.append(point)
    for index, point in enumerate(points): push(point, points[max(0, index - COARSEST):index])
    for of, points, colours in reversed(levels):
        for p in sorted((p for p in range(len(points)) if colours[p]), key=lambda p: (colours[p], p)):
            push(points[p], [points[q] for n in of[p] for q in [n] + of[n] if colours[q] < colours[p]])
    return np.array(order, int), np.array(stencils, int).reshape(-1, NEAR), np.array(all_weights, F).reshape(-1, NEAR)

def weights(points, squares, square):
    n = len(points)
    mean = total(math.sqrt(s) for s in squares) / max(n, 1)
    if n < 2 or mean <= 0: return [1.0 / n] * n if n else []
    covariance = lambda s: 64.0 - math.sqrt(s) / mean * math.sqrt(math.sqrt(s) / mean)
    m = [[covariance(square(points[i], points[j])) for j in range(i)] + [64.0 + 0.02] for i in range(n)]
    right, ones = [covariance(s) for s in squares], [1.0] * n
    for i in range(n):
        for j in range(i + 1):
            for k in range(j): m[i][j] -= m[i][k] * m[j][k]
            if j < i: m[i][j] /= m[j][j]
        if not m[i][i] >= 1e-9: return [1.0 / n] * n
        m[i][i] = math.sqrt(m[i][i])
        for side in (right, ones):
            for k in range(i): side[i] -= m[i][k] * side[k]
            side[i] /= m[i][i]
    multiplier = (1.0 - total(a * b for a, b in zip(ones, right))) / total(a * a for a in ones)
    right = [r + multiplier * o for r, o in zip(right, ones)]
    for i in reversed(range(n)):
        for k in range(i + 1, n): right[i] -= m[k][i] * right[k]
        right[i] /= m[i][i]
    return right

def power(base, exponent):
    result = 1.0
    while exponent:
        if exponent & 1: result *= base
        base, exponent = base * base, exponent >> 1
    return result

def table(width):  # The token of each of 4096 slots, and for each token its frequency and its first slot.
    def probability(width, token):
        ratio, (first, plain) = width / (1.0 + width), least(token)
        tail = lambda u: 0.5 * (power(ratio, u - 1) + power(ratio, u + 1)) if u else 1.0
        if token == 0: return 1.0 - ratio
        if token >= 32: return tail(first) - tail(first + (1 << plain))
        magnitude = (first + 1) // 2
        return 0.5 * (power(ratio, 2 * magnitude - 1) - power(ratio, 2 * magnitude + 1))
    mixed = [(15.0 * probability(width, t) + probability(4.0 * width + 0.02, t)) / 16.0 for t in range(86)]
    frequencies = [math.floor(p * 4096.0 + 0.5) for p in mixed] + [1]
    frequencies[frequencies.index(max(frequencies))] += 4096 - sum(frequencies)
    slots = [token for token, frequency in enumerate(frequencies) for _ in range(frequency)]
    return slots, [(f, sum(frequencies[:t])) for t, f in enumerate(frequencies)]

def least(token): return (token, 0) if token < 32 else (2 + token % 2 << token // 2 - 12, token // 2 - 12)

widths = [1 / 256]
while len(widths) < 40: widths.append(widths[-1] * math.sqrt(2.0))
TABLES = [table(width) for width in widths]

class Field:
    def __init__(self, components, of): self.components, (_, self.stencils, self.weights) = components, of; self.exact = None
    def decode(self, data):
        message, n, c = Input(data), len(self.stencils), self.components
        flags = message.take("B")
        if flags & 3 == 0: return np.tile(message.doubles(c), n)
        if flags & 3 > 1:
            self.exact = [self.bits(message.block(), flags, self.exact[i] if flags & 4 else None) for i in range(c)]
            return np.stack(self.exact, 1).ravel()
        exponent, steps = message.take("h"), message.take("B")
        if flags & 4:
            self.nodes[:, :, 2] = self.nodes[:, :, 0 if self.frames == 1 else 1] * F(2.0 ** (self.exponent - exponent))
            self.nodes[:, :, 1] = self.nodes[:, :, 0] * F(2.0 ** (self.exponent - exponent))
        else:
            self.offsets = np.frombuffer(message.bytes(4 * c), "<f4").astype(float)
            self.nodes, self.frames = np.zeros((c, n, 4), F), 0
            self.tables, self.mask = [list(FIRST_TABLES) for _ in range(c)], None
        self.exponent, self.frames = exponent, self.frames + 1
        if flags & 16:
            self.of, self.tuples = np.zeros(n, int), []
            byte = message.take("B")
            for number in range(1, (byte & 7) + 1):
                self.tuples.append(np.zeros(c) if byte >> 2 + number & 1 else message.doubles(c))
                self.masked(message.block(), number)
            self.mask = self.of > 0
        elif not flags & 8: self.mask = None
        if self.mask is not None:
            for number, tuple_ in enumerate(self.tuples, 1):
                steps_of = (tuple_ - self.offsets) * 2.0 ** -exponent
                self.nodes[:, self.of == number, 0] = np.where(abs(steps_of) <= 1 << 23, np.rint(steps_of), 0)[:, None]
            self.nodes[:, self.mask, 3] = 0
        for i in range(c): self.plane(message, i, F(steps))
        values = (self.offsets + self.nodes[:, :, 0].T.astype(float) * 2.0 ** exponent)
        if self.mask is not None: values[self.mask] = np.array(self.tuples)[self.of[self.mask] - 1]
        values, place = values.ravel(), -1
        for _ in range(message.count() if flags & 32 else 0):
            place += message.count() + 1
            values[place] = message.take("d")
        return values
    def masked(self, data, number):
        bits, models = Bits(data), [model() for _ in range(5)]
        for p, s in enumerate(self.stencils):
            if not self.of[p] and bits.bit(models[int((self.of[s[:4]] == number).sum())]): self.of[p] = number
    def bits(self, data, flags, last):
        bits, models, double, lengths = Bits(data), [number() for _ in range(9)], flags & 3 == 3, []
        values, (real, whole, width) = np.zeros(len(self.stencils)), ("<d", "<q", 64) if double else ("<f", "<i", 32)
        flip = lambda v: v ^ (1 << width - 1) - 1 if v < 0 else v
        wrap = lambda v, width: (v + (1 << width - 1)) % (1 << width) - (1 << width - 1)
        for p, s in enumerate(self.stencils):
            near = total(float(w) * values[q] for q, w in zip(s, self.weights[p]) if w) if last is None else last[p]
            near = np.array(near if np.isfinite(near) else 0.0).astype(real)
            coded = bits.number(models[(lengths[s[0]] + 7) // 8 if lengths else 0])
            lengths.append(coded.bit_length())
            value = wrap(wrap(flip(int(near.view(whole))) + unzigzag(coded), 64), width)
            values[p] = struct.unpack(real, struct.pack(whole, flip(value)))[0]
        return values
    def plane(self, message, component, step):
        nodes, tables, flags = self.nodes[component], self.tables[component], message.take("B")
        n, fit, m = len(nodes), None, flags >> 3 & 3
        modes = [m] * -(-n // 256)
        if flags & 32: modes = [b >> 2 * i & 3 for b in message.bytes(-(-len(modes) // 4)) for i in range(4)]
        if flags & 64: fit = [F(part) / F(32) for part in message.take("4b")]
        ways = [[F(0), F(1), F(0), F(0)], [F(0)] * 4, [F(1), F(0), F(0), F(0)], fit or [F(0)] * 4]
        changed = message.count() if flags & 4 else 0
        for i in range(17):
            if changed >> i & 1: tables[i] = message.take("B")
        lanes = 1 << (flags & 3)
        states, words = [message.take("I") for _ in range(lanes)], deque(np.frombuffer(message.bytes(2 * message.count()), "<u2").tolist())
        plain, lane = int.from_bytes(message.block(), "little"), 0
        for p in range(n):
            if self.mask is not None and self.mask[p]: continue
            near, w, sums = nodes[self.stencils[p]], self.weights[p], np.zeros(3, F)
            for j in range(NEAR): sums = sums + w[j] * near[j, :3]
            context = int(sum(c * m for c, m in zip(CONTEXT, near[:, 3])) + 20 * nodes[p, 3])
            context += 12 * int(self.nodes[component - 1][p, 3]) if component else 0
            slots, of_token = TABLES[tables[sum(context >= edge for edge in EDGES)]]
            state, slot = states[lane], states[lane] & 4095
            frequency, start = of_token[slots[slot]]
            state = frequency * (state >> 12) + slot - start
            states[lane] = state << 16 | words.popleft() if state < 1 << 16 else state
            lane = (lane + 1) % lanes
            first, count = least(slots[slot]) if slots[slot] < 86 else (0, 32)
            value, plain = first + (plain & (1 << count) - 1), plain >> count
            (now, before, earlier), (a, b, c, d), (_, last, second, _) = sums, ways[modes[p // 256]], nodes[p]
            guess = last + a * (now - before) + b * (now - last) + c * (last - second) + d * (before - earlier)
            nodes[p, 0] = (guess + F(12582912)) - F(12582912) + step * F(unzigzag(value))
            nodes[p, 3] = min(abs(unzigzag(value)), 64)
        assert not words and states == [1 << 16] * lanes

def main(folder):
    *both, positions, triangles, features, lines = topology(open(folder + "/topology", "rb").read())
    message = Input(open(folder + "/fields", "rb").read())
    out = open(folder + "/decoded", "wb")
    for array, kind in ((positions, "<f8"), (triangles, "<u4"), (features, "<u4"), (lines, "<u4")): out.write(np.array(array).astype(kind).tobytes())
    while message.at < len(message.data):
        which, components, frames = message.take("3B")
        field = Field(components, both[which])
        for _ in range(frames): out.write(field.decode(message.bytes(message.take("I"))).tobytes())

if __name__ == "__main__": main(sys.argv[1])
