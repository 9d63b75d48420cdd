//! Expressions as a graph in which equal subexpressions are one node.

use std::collections::HashMap;

use super::scalar::Scalar;

/// Index of a node; operands come before what uses them.
pub(super) type NodeId = u32;

/// Functions of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Unary {
    Neg,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sqrt,
    Exp,
    Log,
    Abs,
}

/// Functions of two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
    Atan2,
    Hypot,
    Min,
    Max,
}

/// One step of a computation. Constants are kept as bits, so that nodes can be compared and hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Node {
    Constant(u64),
    Variable(u32),
    Unary(Unary, NodeId),
    Binary(Binary, NodeId, NodeId),
    /// `a + c`.
    Shift(NodeId, u64),
    /// `c a`.
    Scale(NodeId, u64),
    /// A whole power.
    PowI(NodeId, i32),
    /// A constant power that is not whole.
    PowF(NodeId, u64),
}

/// Nodes in the order of computation.
#[derive(Clone, Debug, Default)]
pub(super) struct Graph {
    pub nodes: Vec<Node>,
    /// Looked up only, never iterated: its order does not matter.
    index: HashMap<Node, NodeId>,
}

impl Graph {
    fn intern(&mut self, node: Node) -> NodeId {
        let nodes = &mut self.nodes;
        *self.index.entry(node).or_insert_with(|| {
            nodes.push(node);
            (nodes.len() - 1) as NodeId
        })
    }

    pub fn value(&self, id: NodeId) -> Option<f64> {
        match self.nodes[id as usize] {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    pub fn constant(&mut self, value: f64) -> NodeId {
        // One zero only.
        self.intern(Node::Constant((value + 0.0).to_bits()))
    }

    pub fn variable(&mut self, index: u32) -> NodeId {
        self.intern(Node::Variable(index))
    }

    pub fn unary(&mut self, f: Unary, a: NodeId) -> NodeId {
        if let Some(x) = self.value(a) {
            let y = apply_unary(f, x);
            // What is not finite stays an operation: intervals and messages know better.
            if y.is_finite() {
                return self.constant(y);
            }
        }
        match (f, self.nodes[a as usize]) {
            (Unary::Neg, Node::Unary(Unary::Neg, b)) => b,
            _ => self.intern(Node::Unary(f, a)),
        }
    }

    pub fn binary(&mut self, f: Binary, a: NodeId, b: NodeId) -> NodeId {
        let (x, y) = (self.value(a), self.value(b));
        if let (Some(x), Some(y)) = (x, y) {
            let z = apply_binary(f, x, y);
            if z.is_finite() {
                return self.constant(z);
            }
        }
        match (f, x, y) {
            (Binary::Add, None, Some(c)) => self.shift(a, c),
            (Binary::Add, Some(c), None) => self.shift(b, c),
            (Binary::Sub, None, Some(c)) => self.shift(a, -c),
            (Binary::Sub, Some(c), None) => {
                let minus = self.unary(Unary::Neg, b);
                self.shift(minus, c)
            }
            (Binary::Mul, None, Some(c)) => self.scale(a, c),
            (Binary::Mul, Some(c), None) => self.scale(b, c),
            (Binary::Mul, ..) if a == b => self.power(a, 2.0),
            (Binary::Div, _, Some(1.0)) => a,
            (Binary::Pow, None, Some(c)) => self.power(a, c),
            // Commuting operands in one order make more nodes equal.
            (Binary::Add | Binary::Mul | Binary::Hypot | Binary::Min | Binary::Max, ..) => {
                self.intern(Node::Binary(f, a.min(b), a.max(b)))
            }
            _ => self.intern(Node::Binary(f, a, b)),
        }
    }

    fn shift(&mut self, a: NodeId, c: f64) -> NodeId {
        if c == 0.0 { a } else { self.intern(Node::Shift(a, c.to_bits())) }
    }

    fn scale(&mut self, a: NodeId, c: f64) -> NodeId {
        if c == 1.0 { a } else { self.intern(Node::Scale(a, (c + 0.0).to_bits())) }
    }

    fn power(&mut self, a: NodeId, c: f64) -> NodeId {
        if c == 1.0 {
            a
        } else if c == 0.5 {
            self.unary(Unary::Sqrt, a)
        } else if c.fract() == 0.0 && c.abs() < f64::from(i32::MAX) {
            self.intern(Node::PowI(a, c as i32))
        } else {
            self.intern(Node::PowF(a, c.to_bits()))
        }
    }

    /// Adds a node of another graph, whose operands `map` has already translated.
    pub fn adopt(&mut self, node: Node, map: &[NodeId]) -> NodeId {
        let at = |a: NodeId| map[a as usize];
        match node {
            Node::Constant(_) | Node::Variable(_) => self.intern(node),
            Node::Unary(f, a) => self.intern(Node::Unary(f, at(a))),
            Node::Binary(f, a, b) => self.binary(f, at(a), at(b)),
            Node::Shift(a, c) => self.intern(Node::Shift(at(a), c)),
            Node::Scale(a, c) => self.intern(Node::Scale(at(a), c)),
            Node::PowI(a, n) => self.intern(Node::PowI(at(a), n)),
            Node::PowF(a, c) => self.intern(Node::PowF(at(a), c)),
        }
    }
}

impl Node {
    /// The nodes it reads.
    pub fn operands(&self) -> impl Iterator<Item = NodeId> + use<> {
        let (a, b) = match *self {
            Node::Constant(_) | Node::Variable(_) => (None, None),
            Node::Unary(_, a)
            | Node::Shift(a, _)
            | Node::Scale(a, _)
            | Node::PowI(a, _)
            | Node::PowF(a, _) => (Some(a), None),
            Node::Binary(_, a, b) => (Some(a), Some(b)),
        };
        a.into_iter().chain(b)
    }
}

/// A function of one value, over any scalar.
pub(super) fn apply_unary<T: Scalar>(f: Unary, x: T) -> T {
    match f {
        Unary::Neg => -x,
        Unary::Sin => x.sin_cos().0,
        Unary::Cos => x.sin_cos().1,
        Unary::Tan => x.tan(),
        Unary::Asin => x.asin(),
        Unary::Acos => x.acos(),
        Unary::Atan => x.atan(),
        Unary::Sqrt => x.sqrt(),
        Unary::Exp => x.exp(),
        Unary::Log => x.log(),
        Unary::Abs => x.abs(),
    }
}

/// A function of two values, over any scalar.
pub(super) fn apply_binary<T: Scalar>(f: Binary, x: T, y: T) -> T {
    match f {
        Binary::Add => x + y,
        Binary::Sub => x - y,
        Binary::Mul => x * y,
        Binary::Div => x / y,
        Binary::Pow => x.pow(y),
        Binary::Atan2 => x.atan2(y),
        Binary::Hypot => x.hypot(y),
        Binary::Min => x.min(y),
        Binary::Max => x.max(y),
    }
}
