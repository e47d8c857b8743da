set datafile separator ','
set datafile missing NaN
set terminal svg noenhanced size 720,480 font 'sans,13'
set key outside below
set grid
set format y '%g'
set output 'bulk-auto-strain.svg'
set title 'strain at the end of compression'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-strain.svg'
set title 'strain at the end of compression'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set format y '%g'
set output 'bulk-auto-porosity.svg'
set title 'porosity there'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-porosity.svg'
set title 'porosity there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set format y '%g'
set output 'bulk-auto-coordination_number.svg'
set title 'coordination number there'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-coordination_number.svg'
set title 'coordination number there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set format y '%g'
set output 'bulk-auto-strength.svg'
set title 'unconfined strength (Pa)'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-strength.svg'
set title 'unconfined strength (Pa)'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strength' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
