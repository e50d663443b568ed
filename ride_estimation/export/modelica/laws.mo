  package Laws "Force laws: deflection x and rate v in, tension out, both positive in extension; SI units"

    record Known "A parameter of an element and what is known of it; -1 where a number of the last six is not known"
      Real value "value";
      String unit_name "unit";
      Real lower = -1e300 "lowest value it can have";
      Real upper = 1e300 "highest value it can have";
      Real std = -1 "standard deviation";
      Real largest_deflection = -1 "seen in the data [m] or [rad]";
      Real lowest_frequency = -1 "seen in the data [Hz]";
      Real highest_frequency = -1 "seen in the data [Hz]";
    end Known;

    partial model Law
      input Real x "deflection";
      input Real v "its time derivative";
      Real force "tension";
    end Law;

    model Elastic "Linear and cubic spring with a viscous damper"
      extends Law;
      parameter Real k "spring rate";
      parameter Real k3 "cubic rate";
      parameter Real c "damping";
    equation
      force = x*(k + k3*x^2) + c*v;
    end Elastic;

    model Maxwell "Spring and damper in series"
      extends Law;
      parameter Real k "spring rate";
      parameter Real corner "spring rate over damping [rad/s]";
      Real m(start = 0, fixed = true) "force of the cell";
    equation
      der(m) = k*v - corner*m;
      force = m;
    end Maxwell;

    model Berg "Smooth friction of filled rubber"
      extends Law;
      parameter Real friction "largest friction force";
      parameter Real half_stroke "stroke from rest to half the largest friction force";
      Real z(start = 0, fixed = true) "share of the largest friction force";
      discrete Real room(start = 1, fixed = true) "what was left to the limit at the last reversal";
    equation
      when v > 0 then
        room = 1 - z;
      elsewhen v < 0 then
        room = 1 + z;
      end when;
      der(z) = v/half_stroke*((if v >= 0 then 1 - z else 1 + z)/room)^2;
      force = friction*z;
    end Berg;

    model Dahl "Dahl friction"
      extends Law;
      parameter Real friction "largest friction force";
      parameter Real slope "stiffness at no force";
      parameter Real exponent "exponent";
      Real z(start = 0, fixed = true) "share of the largest friction force";
      Real room "what is left to the limit in the direction of motion";
    equation
      room = noEvent(max(if v >= 0 then 1 - z else 1 + z, 0));
      der(z) = if friction > 0 then v*slope/friction*room^exponent else 0;
      force = friction*z;
    end Dahl;

    model BoucWen "Bouc-Wen friction"
      extends Law;
      parameter Real friction "largest friction force";
      parameter Real slope "stiffness at no force";
      parameter Real exponent "exponent";
      parameter Real share "share of the unloading slope";
      Real z(start = 0, fixed = true) "share of the largest friction force";
      Real bend "what the slope loses";
    equation
      bend = noEvent(if v*z >= 0 then -abs(z)^exponent else (2*share - 1)*abs(z)^exponent);
      der(z) = if friction > 0 then v*slope/friction*(1 + bend) else 0;
      force = friction*z;
    end BoucWen;

    model Stop "One-sided stop: pushes, never pulls; contact begins smoothly"
      extends Law;
      parameter Real side "1 in extension, -1 in compression";
      parameter Real gap "distance to the stop";
      parameter Real half_width "half width of the entry";
      parameter Real k "spring rate";
      parameter Real k3 "cubic rate";
      parameter Real c "damping";
      Real e "distance past the gap";
      Real u "penetration";
      Real share "slope of the penetration";
    equation
      e = side*x - gap;
      u = noEvent(if e <= -half_width then 0 elseif e < half_width then (e + half_width)^2/(4*half_width) else e);
      share = noEvent(if e <= -half_width then 0 elseif e < half_width then (e + half_width)/(2*half_width) else 1);
      force = side*noEvent(if u > 0 then max(k*u + k3*u^3 + c*share*side*v, 0) else 0);
    end Stop;

    model ContactMaxwell "Maxwell cell that pushes behind a contact point and forgets when it leaves it"
      extends Law;
      parameter Real side "1 in extension, -1 in compression";
      parameter Real gap "distance to the contact point";
      parameter Real half_width "half width of the entry";
      parameter Real k "spring rate";
      parameter Real corner "spring rate over damping [rad/s]";
      Real e "distance past the contact point";
      Real share "slope of the penetration";
      Real m(start = 0, fixed = true) "force of the cell";
    equation
      e = side*x - gap;
      share = noEvent(if e <= -half_width then 0 elseif e < half_width then (e + half_width)/(2*half_width) else 1);
      der(m) = noEvent(if e > -half_width then k*share*side*v - corner*m else 0);
      force = side*noEvent(if e > -half_width then max(m, 0) else 0);
      when e <= -half_width then
        reinit(m, 0);
      end when;
    end ContactMaxwell;

    model PowerSpring "Power law of the deflection"
      extends Law;
      parameter Real k "force at the reference over the reference";
      parameter Real reference "reference deflection";
      parameter Real exponent "exponent";
      parameter Real rounding "width over which the corner at zero is rounded";
    equation
      force = noEvent(if abs(x) > 0 then k*x*(sqrt(x^2 + rounding^2)/reference)^(exponent - 1) else 0);
    end PowerSpring;

    model PowerDamper "Power law of the rate"
      extends Law;
      parameter Real c "force at the reference over the reference";
      parameter Real reference "reference rate";
      parameter Real exponent "exponent";
      parameter Real rounding "width over which the corner at zero is rounded";
    equation
      force = noEvent(if abs(v) > 0 then c*v*(sqrt(v^2 + rounding^2)/reference)^(exponent - 1) else 0);
    end PowerDamper;

    model AsymmetricDamper "Viscous damper, other in extension than in compression"
      extends Law;
      parameter Real extension "damping in extension";
      parameter Real compression "damping in compression";
    equation
      force = noEvent(if v > 0 then extension*v else compression*v);
    end AsymmetricDamper;

    model Stribeck "Friction of the momentary rate"
      extends Law;
      parameter Real kinetic "friction force in motion";
      parameter Real static "largest friction force at low speed";
      parameter Real stribeck_speed "speed at which it has fallen";
      parameter Real rounding_speed "speed over which the sign is rounded";
    equation
      force = (kinetic + (static - kinetic)*exp(-(v/stribeck_speed)^2))*tanh(v/rounding_speed);
    end Stribeck;

    model CurveSpring "Curve over the deflection"
      extends Law;
      parameter Real side "1 in extension, -1 in compression";
      parameter Real offset "where the curve begins";
      parameter Real points[:] "deflections";
      parameter Real values[:] "forces";
      parameter Real slopes[:] "slopes of the curve";
    equation
      force = side*curve(side*x - offset, points, values, slopes);
    end CurveSpring;

    model CurveDamper "Curve over the rate"
      extends Law;
      parameter Real points[:] "rates";
      parameter Real values[:] "forces";
      parameter Real slopes[:] "slopes of the curve";
    equation
      force = curve(v, points, values, slopes);
    end CurveDamper;

    model WeightedDahl "Dahl friction whose height and slope follow a curve over the travel"
      extends Law;
      parameter Real side "1 in extension, -1 in compression";
      parameter Real offset "where travel begins";
      parameter Real reference "height at the reference travel";
      parameter Real lowest_slope "slope at no travel";
      parameter Real highest_slope "slope at the reference travel";
      parameter Real exponent "distortion";
      parameter Real points[:] "travels";
      parameter Real values[:] "heights";
      parameter Real slopes[:] "slopes of the curve";
      Real height "height of the hysteresis over that at the reference";
      Real z(start = 0, fixed = true) "share of half the height";
      Real rate "rate of the travel";
    equation
      height = noEvent(max(curve(side*x - offset, points, values, slopes), 0))/reference;
      rate = side*v;
      der(z) = rate*(lowest_slope + height^exponent*(highest_slope - lowest_slope))/(reference/2)*(if noEvent(rate >= 0) then 1 - z else 1 + z);
      force = side*reference/2*z*height;
    end WeightedDahl;

    model RateFilter "Second-order filter of the rate, (c1 s + c0)/(s^2 + a1 s + a0) + d"
      extends Law;
      parameter Real a1 "of the denominator";
      parameter Real a0 "of the denominator";
      parameter Real c1 "of the numerator";
      parameter Real c0 "of the numerator";
      parameter Real d "direct";
      Real z1(start = 0, fixed = true) "first state";
      Real z2(start = 0, fixed = true) "second state";
    equation
      der(z1) = z2;
      der(z2) = v - a1*z2 - a0*z1;
      force = c1*z2 + c0*z1 + d*v;
    end RateFilter;

    function curve "Cubic Hermite curve through points, straight outside"
      input Real u "where";
      input Real points[:] "abscissae, increasing";
      input Real values[size(points, 1)] "values";
      input Real slopes[size(points, 1)] "slopes";
      output Real y "value";
    protected
      Integer n;
      Integer i;
      Real w;
      Real t;
    algorithm
      n := size(points, 1);
      if u <= points[1] then
        y := values[1] + slopes[1]*(u - points[1]);
      elseif u >= points[n] then
        y := values[n] + slopes[n]*(u - points[n]);
      else
        i := 1;
        while points[i + 1] < u loop
          i := i + 1;
        end while;
        w := points[i + 1] - points[i];
        t := (u - points[i])/w;
        y := (1 - t)^2*(values[i]*(1 + 2*t) + slopes[i]*w*t) + t^2*(values[i + 1]*(3 - 2*t) - slopes[i + 1]*w*(1 - t));
      end if;
    end curve;
  end Laws;
