//! Formulas as straight-line code for a small register machine.

use super::graph::{Binary, Graph, Node, NodeId, Unary, apply_binary, apply_unary};
use super::interval::Interval;
use super::parse::{Formula, FormulaError};
use super::scalar::Scalar;

/// Most values that may be alive at once. Scratch for them lies on the stack: 96 KiB of second-order
/// interval jets at most.
pub const MAX_LIVE_VALUES: usize = 1024;

type Register = u16;

/// Several formulas of the same variables, equal parts computed once.
///
/// Evaluation is total, allocates nothing, and does the same operations in the same order for every
/// kind of scalar.
#[derive(Clone, Debug)]
pub struct Tape {
    steps: Vec<Step>,
    outputs: Vec<Register>,
    registers: usize,
    variables: usize,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    operation: Operation,
    to: Register,
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    Constant(f64),
    Variable(u32),
    Unary(Unary, Register),
    Binary(Binary, Register, Register),
    Shift(Register, f64),
    Scale(Register, f64),
    PowI(Register, i32),
    PowF(Register, f64),
    /// The sine goes to the step's register, the cosine to the second one here.
    SinCos(Register, Register),
}

impl Tape {
    /// Compiles formulas, one output each, of the same variables.
    ///
    /// # Errors
    /// If more than [`MAX_LIVE_VALUES`] intermediate values are needed at once.
    pub fn compile(formulas: &[Formula]) -> Result<Self, FormulaError> {
        let mut graph = Graph::default();
        let mut roots = Vec::new();
        for formula in formulas {
            let mut map: Vec<NodeId> = Vec::with_capacity(formula.graph.nodes.len());
            for node in &formula.graph.nodes {
                let id = graph.adopt(*node, &map);
                map.push(id);
            }
            roots.push(map[formula.root as usize]);
        }
        let variables = formulas.iter().map(|f| f.variables).max().unwrap_or(0);
        Assembler::new(&graph, &roots).assemble(variables)
    }

    /// Number of formulas.
    pub fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// Number of variables.
    pub fn variable_count(&self) -> usize {
        self.variables
    }

    /// Evaluates all outputs at `inputs`, one for each variable (missing ones are 0). Entries of the
    /// result beyond the tape's outputs are 0.
    pub fn evaluate<T: Scalar, const N: usize>(&self, inputs: &[T]) -> [T; N] {
        // Small scratch first: it has to be filled, and most tapes are short.
        match self.registers {
            0..=8 => self.run::<T, 8, N>(inputs),
            9..=24 => self.run::<T, 24, N>(inputs),
            25..=128 => self.run::<T, 128, N>(inputs),
            _ => self.run::<T, MAX_LIVE_VALUES, N>(inputs),
        }
    }

    fn run<T: Scalar, const R: usize, const N: usize>(&self, inputs: &[T]) -> [T; N] {
        let mut r = [T::constant(0.0); R];
        for step in &self.steps {
            self.step(step, inputs, &mut r);
        }
        std::array::from_fn(|i| {
            let register = self.outputs.get(i).and_then(|k| r.get(*k as usize));
            register.copied().unwrap_or_else(|| T::constant(0.0))
        })
    }

    #[inline(always)]
    fn step<T: Scalar>(&self, step: &Step, inputs: &[T], r: &mut [T]) {
        let at = |k: Register| r[k as usize];
        let value = match step.operation {
            Operation::Constant(c) => T::constant(c),
            Operation::Variable(i) => {
                inputs.get(i as usize).copied().unwrap_or_else(|| T::constant(0.0))
            }
            Operation::Unary(f, a) => apply_unary(f, at(a)),
            Operation::Binary(f, a, b) => apply_binary(f, at(a), at(b)),
            Operation::Shift(a, c) => at(a).shifted(c),
            Operation::Scale(a, c) => at(a).scaled(c),
            Operation::PowI(a, n) => at(a).powi(n),
            Operation::PowF(a, c) => at(a).powf(c),
            Operation::SinCos(a, cosine) => {
                let (s, c) = at(a).sin_cos();
                r[cosine as usize] = c;
                s
            }
        };
        r[step.to as usize] = value;
    }

    /// Whether every operation is defined, and every result finite, at all points of the box: proved
    /// if true, open if false.
    pub fn is_finite_on(&self, inputs: &[Interval]) -> bool {
        let mut r = [Interval::ZERO; MAX_LIVE_VALUES];
        self.steps.iter().all(|step| {
            let defined = {
                let at = |k: Register| r[k as usize];
                match step.operation {
                    Operation::Unary(Unary::Sqrt, a) => at(a).lo >= 0.0,
                    Operation::Unary(Unary::Log, a) => at(a).lo > 0.0,
                    Operation::Unary(Unary::Asin | Unary::Acos, a) => {
                        at(a).lo >= -1.0 && at(a).hi <= 1.0
                    }
                    Operation::Binary(Binary::Div, _, b) => !at(b).contains(0.0),
                    Operation::Binary(Binary::Pow, a, b) => {
                        at(a).lo > 0.0 || (at(a).lo >= 0.0 && at(b).lo > 0.0)
                    }
                    Operation::PowF(a, c) => at(a).lo > 0.0 || (at(a).lo >= 0.0 && c > 0.0),
                    Operation::PowI(a, n) => n >= 0 || !at(a).contains(0.0),
                    _ => true,
                }
            };
            self.step(step, inputs, &mut r);
            defined && r[step.to as usize].is_bounded()
        })
    }
}

/// Gives registers to nodes.
struct Assembler<'g> {
    graph: &'g Graph,
    roots: &'g [NodeId],
    /// For each node the last node that reads it, `u32::MAX` for outputs, `None` if unused.
    last_use: Vec<Option<NodeId>>,
    /// For a sine the later cosine of the same angle, and the other way round: one step makes both.
    partner: Vec<Option<NodeId>>,
    register: Vec<Option<Register>>,
    free: Vec<Register>,
    count: usize,
}

impl<'g> Assembler<'g> {
    fn new(graph: &'g Graph, roots: &'g [NodeId]) -> Self {
        let n = graph.nodes.len();
        let mut used = vec![false; n];
        for r in roots {
            used[*r as usize] = true;
        }
        for i in (0..n).rev() {
            if used[i] {
                graph.nodes[i].operands().for_each(|a| used[a as usize] = true);
            }
        }
        // The first of a sine and cosine of the same angle, by angle.
        let mut first: Vec<Option<NodeId>> = vec![None; n];
        let mut partner = vec![None; n];
        // When a node is computed: with its partner, if that comes first.
        let mut time: Vec<NodeId> = (0..n as NodeId).collect();
        for i in (0..n).filter(|i| used[*i]) {
            if let Node::Unary(Unary::Sin | Unary::Cos, a) = graph.nodes[i] {
                match first[a as usize] {
                    None => first[a as usize] = Some(i as NodeId),
                    Some(j) => {
                        partner[j as usize] = Some(i as NodeId);
                        time[i] = j;
                    }
                }
            }
        }
        let mut last_use: Vec<Option<NodeId>> = vec![None; n];
        for i in (0..n).filter(|i| used[*i]) {
            for a in graph.nodes[i].operands() {
                last_use[a as usize] = last_use[a as usize].max(Some(time[i]));
            }
        }
        for r in roots {
            last_use[*r as usize] = Some(NodeId::MAX);
        }
        Self { graph, roots, last_use, partner, register: vec![None; n], free: vec![], count: 0 }
    }

    fn claim(&mut self, node: usize) -> Register {
        let register = self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            // Beyond the limit the register does not matter: assembling fails in the end.
            (self.count - 1).min(MAX_LIVE_VALUES) as Register
        });
        self.register[node] = Some(register);
        register
    }

    fn assemble(mut self, variables: usize) -> Result<Tape, FormulaError> {
        let mut steps = Vec::new();
        for i in 0..self.graph.nodes.len() {
            if self.last_use[i].is_none() || self.register[i].is_some() {
                continue; // unused, or made together with its partner
            }
            let node = self.graph.nodes[i];
            let at = |a: NodeId| self.register[a as usize].unwrap_or(0);
            let operation = match node {
                Node::Constant(c) => Operation::Constant(f64::from_bits(c)),
                Node::Variable(v) => Operation::Variable(v),
                Node::Unary(f, a) => Operation::Unary(f, at(a)),
                Node::Binary(f, a, b) => Operation::Binary(f, at(a), at(b)),
                Node::Shift(a, c) => Operation::Shift(at(a), f64::from_bits(c)),
                Node::Scale(a, c) => Operation::Scale(at(a), f64::from_bits(c)),
                Node::PowI(a, n) => Operation::PowI(at(a), n),
                Node::PowF(a, c) => Operation::PowF(at(a), f64::from_bits(c)),
            };
            match (self.partner[i], operation) {
                (Some(j), Operation::Unary(f, a)) => {
                    // Two are written while one is still read: its register is freed afterwards.
                    let (to, other) = (self.claim(i), self.claim(j as usize));
                    self.release(node, i);
                    let (sine, cosine) = if f == Unary::Sin { (to, other) } else { (other, to) };
                    steps.push(Step { operation: Operation::SinCos(a, cosine), to: sine });
                }
                _ => {
                    // A step reads all before it writes: it may write to what it reads last.
                    self.release(node, i);
                    let to = self.claim(i);
                    steps.push(Step { operation, to });
                }
            }
        }
        if self.count > MAX_LIVE_VALUES {
            return Err(FormulaError {
                span: 0..0,
                message: format!(
                    "The formulas need {} intermediate values at once; at most {MAX_LIVE_VALUES} are \
                     possible. Simplify them.",
                    self.count
                ),
            });
        }
        let outputs = self.roots.iter().filter_map(|r| self.register[*r as usize]).collect();
        Ok(Tape { steps, outputs, registers: self.count, variables })
    }

    /// Frees the registers of operands of `node` that nothing after node `now` reads.
    fn release(&mut self, node: Node, now: usize) {
        let mut seen = None;
        for a in node.operands() {
            if seen == Some(a) {
                continue; // both operands are the same node
            }
            seen = Some(a);
            let done = self.last_use[a as usize].is_some_and(|last| last as usize <= now);
            if let (true, Some(r)) = (done, self.register[a as usize]) {
                self.free.push(r);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::formula::{Jet1, Jet2};

    fn formula(text: &str) -> Formula {
        Formula::parse(text, &["s", "t"], &[("a".into(), 2.5)]).unwrap()
    }

    fn value(text: &str, s: f64, t: f64) -> f64 {
        Tape::compile(&[formula(text)]).unwrap().evaluate::<f64, 1>(&[s, t])[0]
    }

    #[test]
    fn precedence_and_associativity() {
        assert_eq!(value("-s^2", 3.0, 0.0), -9.0);
        assert_eq!(value("2^3^2", 0.0, 0.0), 512.0);
        assert_eq!(value("s^t^2", 2.0, 3.0), 512.0);
        assert_eq!(value("2^-1", 0.0, 0.0), 0.5);
        assert_eq!(value("s^-1*4", 2.0, 0.0), 2.0);
        assert_eq!(value("s-t-1", 5.0, 3.0), 1.0);
        assert_eq!(value("1-s", 5.0, 3.0), -4.0);
        assert_eq!(value("s/t/2", 12.0, 3.0), 2.0);
        assert_eq!(value("s+t*2", 1.0, 3.0), 7.0);
        assert_eq!(value("(s+t)*2", 1.0, 3.0), 8.0);
        assert_eq!(value("-s*-t", 2.0, 3.0), 6.0);
        assert_eq!(value("2*-s^2/+t", 2.0, 4.0), -2.0);
        assert_eq!(value("min(s, t, 1) + max(s,t)", 2.0, 3.0), 4.0);
        assert_eq!(value("a*s + 125e-3 + .5e+1", 2.0, 3.0), 10.125);
        assert_eq!(value("atan2(s, t)", 1.0, -1.0), 0.75 * std::f64::consts::PI);
        assert_eq!(value("hypot(s, t) - pi", 3.0, 4.0), 5.0 - std::f64::consts::PI);
        assert_eq!(value("s - s", 3.0, 4.0), 0.0);
    }

    #[test]
    fn equal_parts_are_computed_once() {
        let tape = Tape::compile(&[
            formula("cos(pi*s)*sin(pi*t)"),
            formula("sin(pi*t)*cos(pi*s)+sin(pi*s)"),
            formula("t"),
        ])
        .unwrap();
        // s, t, πs, πt, (sin, cos) πs, sin πt, product, sum
        assert_eq!(tape.steps.len(), 8);
        let (s, t) = (0.3, 0.7);
        let [x, y, z] = tape.evaluate::<f64, 3>(&[s, t]);
        let pi = std::f64::consts::PI;
        assert_eq!(x, libm::cos(pi * s) * libm::sin(pi * t));
        assert_eq!(y, x + libm::sin(pi * s));
        assert_eq!(z, t);
    }

    #[test]
    fn every_scalar_gives_the_same_value() {
        let tape = Tape::compile(&[formula(
            "sqrt(abs(s-t))*exp(-s)/(1+t^3) + hypot(s,t)^1.5 - atan2(t,s)*log(1+s) + max(s,t)*tan(s/3)",
        )])
        .unwrap();
        for i in 0..100 {
            let (s, t) = (0.013 + 0.009 * f64::from(i), 0.91 - 0.0071 * f64::from(i));
            let [v] = tape.evaluate::<f64, 1>(&[s, t]);
            let [j] = tape.evaluate::<Jet1<f64>, 1>(&Jet1::variables(s, t));
            let [k] = tape.evaluate::<Jet2<f64>, 1>(&Jet2::variables(s, t));
            assert_eq!(v, j.v);
            assert_eq!(v, k.v);
            assert_eq!(j.g, k.g);
        }
    }

    #[test]
    fn too_many_live_values_are_refused() {
        // Products that share nothing and are summed right to left: each waits for the last.
        let nested = |n: usize| -> String {
            let terms: Vec<String> = (0..n).map(|i| format!("sin(s+{i})")).collect();
            // A list of values first made, then used in the opposite order.
            let up = terms.join("+");
            let down = terms.iter().rev().cloned().collect::<Vec<_>>().join("*");
            format!("({up})+({down})")
        };
        let parse = |n| Formula::parse(&nested(n), &["s", "t"], &[]).unwrap();
        assert!(Tape::compile(&[parse(900)]).is_ok());
        assert!(Tape::compile(&[parse(1200)]).is_err());
    }
}
