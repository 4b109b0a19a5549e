//! Which points are neighbours, on one level and on the next coarser one.
#![expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]

/// The most neighbours of a point that are looked at.
const MOST_NEIGHBOURS: usize = 32;

/// Lists of neighbours, rising, one list after the other.
#[derive(Debug, Clone)]
pub(super) struct Graph {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

/// Where lists of these lengths begin, one list after the other; the last number is where they end.
fn starts(lengths: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut end = 0;
    let ends = lengths.map(|length| {
        end += length;
        end
    });
    std::iter::once(0).chain(ends).collect()
}

impl Graph {
    /// The graph of edges in both directions; of each list only the beginning.
    pub(super) fn new(count: usize, edges: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let (mut above, mut below) = (vec![0; count], vec![0; count]);
        edges.clone().for_each(|[a, b]| {
            above[a.min(b) as usize] += 1;
            below[a.max(b) as usize] += 1;
        });
        let above = starts(above.into_iter());
        let mut next = above.clone();
        let mut higher = vec![0; above[count] as usize];
        edges.for_each(|[a, b]| {
            let next = &mut next[a.min(b) as usize];
            higher[*next as usize] = a.max(b);
            *next += 1;
        });
        let edges = (0u32..).zip(above.windows(2)).flat_map(|(low, list)| {
            let list = &higher[list[0] as usize..list[1] as usize];
            list.iter().map(move |&high| [low, high])
        });
        Self::of_rising(&starts(below.into_iter()), edges)
    }

    /// The graph of edges, each as often as it likes, whose lower ends rise. `room` says where a list
    /// of the lower ends at each higher end can begin. No list has to be sorted: each is written
    /// by ends that rise.
    fn of_rising(room: &[u32], edges: impl Iterator<Item = [u32; 2]>) -> Self {
        let count = room.len() - 1;
        let mut lower = vec![0; room[count] as usize];
        // For each point where its list goes on, and the last that was written there.
        let mut ends: Vec<[u32; 2]> =
            room[..count].iter().map(|&start| [start, u32::MAX]).collect();
        edges.for_each(|[low, high]| {
            let [end, last] = &mut ends[high as usize];
            // No branch: whether an edge was met before comes as a surprise each time.
            lower[*end as usize] = low;
            *end += u32::from(low != *last && low != high);
            *last = low;
        });
        let lower_of = |point: usize| &lower[room[point] as usize..ends[point][0] as usize];
        let mut above = vec![0u32; count];
        for high in 0..count {
            lower_of(high).iter().for_each(|&low| above[low as usize] += 1);
        }
        let most = MOST_NEIGHBOURS as u32;
        let lengths =
            (0..count).map(|point| (ends[point][0] - room[point] + above[point]).min(most));
        let starts = starts(lengths);
        let mut neighbours = vec![0; starts[count] as usize];
        // Where the higher ends at each point go.
        let mut next = above;
        for point in 0..count {
            let list = &mut neighbours[starts[point] as usize..starts[point + 1] as usize];
            list.iter_mut().zip(lower_of(point)).for_each(|(to, &low)| *to = low);
            next[point] = starts[point] + ends[point][0] - room[point];
        }
        for high in 0..count {
            for &low in lower_of(high) {
                let next = &mut next[low as usize];
                if *next < starts[low as usize + 1] {
                    neighbours[*next as usize] = high as u32;
                    *next += 1;
                }
            }
        }
        Self { starts, neighbours }
    }

    #[inline(always)]
    pub(super) fn of(&self, point: u32) -> &[u32] {
        let point = point as usize;
        &self.neighbours[self.starts[point] as usize..self.starts[point + 1] as usize]
    }
}

/// One level: its points by their numbers in the whole, which rise, what is kept of them (colour 0),
/// and the colours of the rest, from 1.
pub(super) struct Level {
    pub(super) graph: Graph,
    pub(super) points: Vec<u32>,
    pub(super) colours: Vec<u8>,
}

impl Level {
    /// Adds the points that are not kept, by colour and then by number.
    pub(super) fn put_in_order(&self, order: &mut Vec<u32>) {
        let mut counts = [0; 1 << 8];
        self.colours.iter().for_each(|&colour| counts[usize::from(colour)] += 1);
        let mut next = starts(counts[1..].iter().copied());
        let before = order.len();
        order.resize(before + next[counts.len() - 1] as usize, 0);
        for (&point, &colour) in self.points.iter().zip(&self.colours).filter(|of| *of.1 > 0) {
            let next = &mut next[usize::from(colour) - 1];
            order[before + *next as usize] = point;
            *next += 1;
        }
    }
}

/// A level, and the next coarser one: a maximal set of points of which no two are neighbours. Each
/// other point belongs to its first neighbour in it; two points of it are neighbours where points
/// that belong to them are.
pub(super) fn coarsen(graph: Graph, points: Vec<u32>) -> (Level, Graph, Vec<u32>) {
    let count = points.len() as u32;
    // The number in the coarser level of what each point belongs to.
    let mut owner = vec![0u32; points.len()];
    let mut kept = Vec::new();
    let mut colours = vec![0u8; points.len()];
    let mut is_kept = vec![false; points.len()];
    // How many points belong to each that is kept.
    let mut members = Vec::new();
    for point in 0..count {
        let first = graph.of(point).iter().find(|&&other| is_kept[other as usize]);
        let of = if let Some(&first) = first {
            owner[first as usize]
        } else {
            is_kept[point as usize] = true;
            kept.push(points[point as usize]);
            members.push(0);
            kept.len() as u32 - 1
        };
        owner[point as usize] = of;
        members[of as usize] += 1;
    }
    // How many edges lead to each that is kept from those before it.
    let mut room = vec![0; kept.len()];
    for point in 0..count {
        let of = owner[point as usize];
        let mut used = 0u64;
        for &other in graph.of(point) {
            used |= 1 << colours[other as usize];
            let other = owner[other as usize];
            room[other as usize] += u32::from(other > of);
        }
        if !is_kept[point as usize] {
            // Colour 0 is that of points that are kept, or have none yet.
            colours[point as usize] = ((used | 1).trailing_ones() as u8).min(63);
        }
    }
    let members = starts(members.into_iter());
    let mut next = members.clone();
    let mut by_owner = vec![0u32; points.len()];
    for (point, &owner) in (0u32..).zip(&owner) {
        let next = &mut next[owner as usize];
        by_owner[*next as usize] = point;
        *next += 1;
    }
    let edges = (0u32..).zip(members.windows(2)).flat_map(|(low, list)| {
        let (graph, owner) = (&graph, &owner);
        let points = &by_owner[list[0] as usize..list[1] as usize];
        points.iter().flat_map(move |&point| {
            let others = graph.of(point).iter().map(|&other| owner[other as usize]);
            others.filter(move |&high| high > low).map(move |high| [low, high])
        })
    });
    let coarser = Graph::of_rising(&starts(room.into_iter()), edges);
    (Level { graph, points, colours }, coarser, kept)
}
