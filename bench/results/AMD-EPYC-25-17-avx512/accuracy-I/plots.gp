set datafile separator ','
set datafile missing NaN
set terminal svg noenhanced size 720,480 font 'sans,13'
set key outside below
set grid
set logscale xy
set format y '%.0e'
set output 'collisions.svg'
set xlabel 'wall time of 48 collisions (s)'
set ylabel 'mean error of restitution'
plot for [k=0:3] 'collisions.csv' index k using 5:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1)
set output 'collisions-step.svg'
set xlabel 'dt / dt_crit'
plot for [k=0:3] 'collisions.csv' index k using 2:3 skip (k == 0 ? 1 : 0) with linespoints title word('elastic damped plastic cohesive', k+1), x*x title 'second order' dashtype 2 lc 'grey', 0.1*x title 'first order' dashtype 3 lc 'grey'
unset logscale
set format y '%g'
set output 'bulk-step-strain.svg'
set title 'strain at the end of compression'
set xlabel 'dt / dt_crit'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-auto-strain.svg'
set title 'strain at the end of compression'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-speed-strain.svg'
set title 'strain at the end of compression'
set xlabel 'plate speed (m/s)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'strain' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'strain' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'strain' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-scale-strain.svg'
set title 'strain at the end of compression'
set xlabel 'R (m)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-strain.svg'
set title 'strain at the end of compression'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'fixed step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'plate speed, twice the standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set logscale x
set output 'work-scale-strain.svg'
set title 'strain at the end of compression'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'size of the spheres, twice the standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(sprintf('%g mm', 1e3*column(2))) skip 1 with labels offset 3,0.6 notitle, 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'strain' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds'
set yrange [*:*]
unset logscale
set format y '%g'
set output 'bulk-step-porosity.svg'
set title 'porosity there'
set xlabel 'dt / dt_crit'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-auto-porosity.svg'
set title 'porosity there'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-speed-porosity.svg'
set title 'porosity there'
set xlabel 'plate speed (m/s)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'porosity' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'porosity' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'porosity' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-scale-porosity.svg'
set title 'porosity there'
set xlabel 'R (m)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-porosity.svg'
set title 'porosity there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'fixed step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'plate speed, twice the standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set logscale x
set output 'work-scale-porosity.svg'
set title 'porosity there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'size of the spheres, twice the standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(sprintf('%g mm', 1e3*column(2))) skip 1 with labels offset 3,0.6 notitle, 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'porosity' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds'
set yrange [*:*]
unset logscale
set format y '%g'
set output 'bulk-step-coordination_number.svg'
set title 'coordination number there'
set xlabel 'dt / dt_crit'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-auto-coordination_number.svg'
set title 'coordination number there'
set xlabel 'safety of the automatic step (0: the smallest fixed one)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-speed-coordination_number.svg'
set title 'coordination number there'
set xlabel 'plate speed (m/s)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'coordination_number' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'coordination_number' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'coordination_number' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'bulk-scale-coordination_number.svg'
set title 'coordination number there'
set xlabel 'R (m)'
set ylabel 'difference'
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(2) : NaN):5:6 skip 1 with yerrorlines title 'difference to the reference, standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(2) : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(2) : NaN):(-column(7)) skip 1 with lines lc 'grey' notitle
set output 'work-coordination_number.svg'
set title 'coordination number there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'fixed step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'auto' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'automatic step, twice the standard error', 'bulk.csv' using (strcol(1) eq 'speed' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'plate speed, twice the standard error', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds', 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(column(7)/2) skip 1 with lines dashtype 2 lc 'grey' title 'half of it'
set yrange [*:*]
set logscale x
set output 'work-scale-coordination_number.svg'
set title 'coordination number there'
set xlabel 'cost of a run (1e9 particle-steps)'
set ylabel '|difference|'
set yrange [0:*]
plot 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(2*column(6)) skip 1 with yerrorbars title 'size of the spheres, twice the standard error', 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):(abs(column(5))):(sprintf('%g mm', 1e3*column(2))) skip 1 with labels offset 3,0.6 notitle, 'bulk.csv' using (strcol(1) eq 'scale' && strcol(4) eq 'coordination_number' ? column(5) != 0 ? column(8) : NaN : NaN):7 skip 1 with lines lc 'grey' title 'scatter between seeds'
set yrange [*:*]
unset logscale
set logscale y
set format y '%.0e'
set output 'energy.svg'
set title 'energy ledger'
set xlabel 'dt / dt_crit'
set ylabel 'ledger residual / dissipated energy'
plot 'bulk.csv' using (strcol(1) eq 'step' && strcol(4) eq 'energy' ? column(2) : NaN):3 skip 1 with linespoints notitle
